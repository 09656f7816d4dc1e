"""Interrupted imitation resumes and ends with the same model."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")


from agents.cli.main import main
from agents.cli.shared_options import RESUME_NOTE
from agents.runtime.worker_processes import WorkerDiedError
from agents.training.imitation import dagger_rollouts
from agents.training.imitation.behavior_cloning import BehaviorCloning
from agents.training.imitation.dagger_rollouts import RolloutRequest, Rollouts
from agents.training.imitation.dataset import COLUMNS, ImitationDataset
from agents.training.learning_curve import TrainingRecord
from tests.support.small_models import same, weights_of
from tests.support.tiny_imitation import Command, Flights, curve_of
from tests.support.waiting import until


def press_in_evaluate(patch: pytest.MonkeyPatch) -> None:
    """Ctrl-C during the first evaluation."""
    evaluate = TrainingRecord.evaluate

    def interrupted(self: TrainingRecord, *others: Any) -> Any:
        signal.raise_signal(signal.SIGINT)
        return evaluate(self, *others)

    patch.setattr(TrainingRecord, "evaluate", interrupted)


def press_in_update(patch: pytest.MonkeyPatch, number: int) -> None:
    """Ctrl-C during an update, counted from 1."""
    update, done = BehaviorCloning.update, []

    def interrupted(self: BehaviorCloning, *others: Any, **more: Any) -> Any:
        done.append(update(self, *others, **more))
        if len(done) == number:
            signal.raise_signal(signal.SIGINT)
        return done[-1]

    patch.setattr(BehaviorCloning, "update", interrupted)


def press_in_flights(patch: pytest.MonkeyPatch, number: int) -> None:
    """Ctrl-C during a share of flights, counted from 1."""
    collect, done = dagger_rollouts.collect, []

    def interrupted(*asked: Any) -> Any:
        done.append(collect(*asked))
        if len(done) == number:
            signal.raise_signal(signal.SIGINT)
        return done[-1]

    patch.setattr(dagger_rollouts, "collect", interrupted)


PRESSES: dict[str, Callable[[pytest.MonkeyPatch], None]] = {
    "after the first round": press_in_evaluate,
    "in the first flights": lambda patch: press_in_flights(patch, 3),
    "in the flights of a round": lambda patch: press_in_flights(patch, 28),
    "in the updates of the first round": lambda patch: press_in_update(patch, 2),
    "in the updates of another round": lambda patch: press_in_update(patch, 7),
}


PLAIN = {"policy_kwargs": {"net_arch": [8], "components": 2}}


@pytest.fixture(scope="module")
def whole() -> list[Any]:
    """Weights and curve of an uninterrupted training, empty until it has run."""
    return []


@pytest.mark.parametrize("when", PRESSES)
def test_a_resumed_training_ends_with_the_weights_of_an_uninterrupted_one(
    when: str,
    command: Command,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    demos: Flights,
    whole: list[Any],
) -> None:
    line = command("dagger", "--demos", "some/pursuit-v0")
    if not whole:
        assert main(line) == 0
        whole[:] = weights_of(tmp_path / "out"), curve_of(tmp_path / "out")
        shutil.rmtree(tmp_path / "out")
    with pytest.MonkeyPatch.context() as patch:
        PRESSES[when](patch)
        assert main(line) == 130
    assert capsys.readouterr().err.endswith("ferguson: interrupted\n")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert not (tmp_path / "out/model.zip").exists()
    debris = [path.name for path in (tmp_path / "out").rglob("*.tmp*")]
    assert not debris
    assert main(line) == 0
    assert curve_of(tmp_path / "out") == whole[1]
    assert same(weights_of(tmp_path / "out"), whole[0])
    assert not (tmp_path / "out/checkpoint").exists()


def test_a_training_whose_workers_always_die_says_so_and_resumes(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("dagger")) == 0
    whole = weights_of(tmp_path / "out"), curve_of(tmp_path / "out")
    capsys.readouterr()
    collect = dagger_rollouts.collect

    def dying(request: RolloutRequest) -> Rollouts:
        if request.stream[1] == 2:
            raise WorkerDiedError("workers died", ())
        return collect(request)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dagger_rollouts, "collect", dying)
        assert main(command("dagger", "--fresh", "--quiet")) == 2
    assert capsys.readouterr().err == "ferguson: workers died\n"
    assert not (tmp_path / "out/model.zip").exists()
    assert main(command("dagger")) == 0
    assert curve_of(tmp_path / "out") == whole[1]
    assert same(weights_of(tmp_path / "out"), whole[0])


def test_a_training_with_the_way_resumes_as_well(command: Command, tmp_path: Path) -> None:
    shown = {"suite": "sparse", "observation": "rays", "rays": 5, "way": 3}
    line = command("dagger", expert="way", policy="mlp-mixture", env_kwargs=shown, **PLAIN)
    assert main(line) == 0
    whole = weights_of(tmp_path / "out"), curve_of(tmp_path / "out")
    shutil.rmtree(tmp_path / "out")
    with pytest.MonkeyPatch.context() as patch:
        press_in_update(patch, 7)
        assert main(line) == 130
    assert main(line) == 0
    assert curve_of(tmp_path / "out") == whole[1]
    assert same(weights_of(tmp_path / "out"), whole[0])


def test_rollouts_of_finished_rounds_are_kept_and_not_repeated(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        press_in_evaluate(patch)
        assert main(command("dagger")) == 130
    kept = [np.load(file) for file in sorted((tmp_path / "out/checkpoint").glob("rows-*.npy"))]
    assert len(kept) == 2  # the first flights and those of a round
    assert kept[0].shape[1] == COLUMNS
    assert not {*kept[0][:, 0]} & {*kept[1][:, 0]}  # in fields of their own
    added: list[np.ndarray] = []
    add = ImitationDataset.add

    def watched(self: ImitationDataset, rows: np.ndarray, *others: Any) -> None:
        added.append(rows)
        add(self, rows, *others)

    monkeypatch.setattr(ImitationDataset, "add", watched)
    assert main(command("dagger")) == 0
    before = np.concatenate(kept)
    np.testing.assert_array_equal(np.concatenate(added)[: len(before)], before)
    seeds = [seed for rows in added for seed in set(rows[:, 0])]
    assert len(seeds) == len(set(seeds))


def test_a_damaged_checkpoint_is_refused_and_fresh_starts_over(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with monkeypatch.context() as patch:
        press_in_evaluate(patch)
        assert main(command("dagger")) == 130
    capsys.readouterr()
    for name in ("state.pt", "rows-000001.npy"):
        file = tmp_path / "out/checkpoint" / name
        whole = file.read_bytes()
        file.write_bytes(whole[: len(whole) // 2])
        assert main(command("dagger")) == 2
        error = capsys.readouterr().err
        assert "cannot be read" in error
        assert "--fresh starts over" in error
        assert error.count("\n") == 1
        file.write_bytes(whole)
    assert main(command("dagger", "--fresh")) == 0


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [7.0, 12.0, 16.0])
def test_ctrl_c_on_a_terminal_stops_workers_quietly(
    seconds: float, command: Command, tmp_path: Path
) -> None:
    line = command("dagger", "--workers", "2", n_envs=60, first=8, updates=400, n_timesteps=10**7)
    training = subprocess.Popen(
        [sys.executable, "-m", "agents.cli.main", *line],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    with training:
        assert until(lambda: (tmp_path / "out/run.json").exists(), 60.0)
        time.sleep(seconds - 6.0)  # among the first flights, or later
        os.killpg(training.pid, signal.SIGINT)  # as a terminal does: workers and all
        _, error = training.communicate(timeout=60.0)
    assert training.returncode == 130
    *learned, first, then, last = error.splitlines()
    assert all(" steps " in line for line in learned)  # a fast machine has evaluated before
    assert "stopping after this update, with a checkpoint" in first
    assert then == RESUME_NOTE
    assert last == "ferguson: interrupted"
