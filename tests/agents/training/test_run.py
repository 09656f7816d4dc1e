"""Training: the files it writes, how it resumes, and invalid runs that it refuses."""

import csv
import json
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")
pytest.importorskip("yaml")

import yaml

from agents.cli.main import main
from agents.demonstrations import reading
from agents.flights.batched import fly_batch
from agents.flights.metrics import score
from agents.models import loading
from agents.training import checkpoint as training_checkpoint
from agents.training.imitation import demonstration_data
from agents.training.learning_curve import TrainingRecord
from ferguson_gym import ENVIRONMENT_ID
from ferguson_gym.world.field_names import get_fields
from tests.fuzz.test_files import unfinished_training
from tests.support.small_models import same, saved, weights_of
from tests.support.tiny_imitation import straight_flights

CHOSEN, REPORTED = "sparse/validation:0-4", "sparse/validation:5-9"
TINY: dict[str, Any] = {
    "n_envs": 4,
    "n_timesteps": 96,
    "eval_freq": 32,
    "policy": "mlp",
    "policy_kwargs": {"net_arch": [8]},
    "env_kwargs": {"suite": "sparse", "observation": "rays", "rays": 5, "fields": 20},
    "learning_rate": "lin_1e-3",
    "batch_size": 8,
}
OF_ALGORITHM: dict[str, dict[str, Any]] = {
    "ppo": {"n_steps": 8, "n_epochs": 1},
    "tqc": {"buffer_size": 64, "learning_starts": 8, "top_quantiles_to_drop_per_net": 1},
}

Command = Callable[..., list[str]]


@pytest.fixture
def command(tmp_path: Path) -> Command:
    """Of a tiny training in tmp_path/out."""

    def arguments(algorithm: str, *more: str, **changes: Any) -> list[str]:
        config = tmp_path / f"{algorithm}.yml"
        recipe = {**TINY, **OF_ALGORITHM[algorithm], **changes}
        config.write_text(yaml.safe_dump({ENVIRONMENT_ID: recipe}))
        where = ["--config", str(config), "--out", str(tmp_path / "out")]
        fields = ["--choose-on", CHOSEN, "--report-on", REPORTED]
        return ["train", algorithm, *where, *fields, *more]

    return arguments


def curve_of(directory: Path) -> list[dict[str, str]]:
    with (directory / "curve.csv").open() as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize(
    ("file", "content", "match"),
    [
        ("curve.csv", "steps,spl\n32,high\n", "curve.csv is damaged .*--fresh starts over"),
        ("curve.csv", "spl\n0.5\n", "curve.csv is damaged"),
        ("best/model.json", None, "holds no SPL; --fresh starts over"),
        ("checkpoint/state.json", '{"steps": "x", "seconds": 1, "updates": 1, "episodes": 0}', "x"),
        ("checkpoint/state.json", "[" * 100_000, "cannot be read"),
        ("run.json", "[" * 100_000, "run.json is damaged; --fresh starts over"),
    ],
)
def test_a_training_does_not_resume_from_damaged_files(
    tmp_path: Path, file: str, content: str | None, match: str
) -> None:
    prepare, directory = unfinished_training(tmp_path, "ppo")
    (place,) = directory.glob(file if "state" not in file else "checkpoint/*/state.json")
    if content is None:
        card = json.loads(place.read_text())
        content = json.dumps(card | {"results": {"chosen_on": {"spl": None}}})
    place.write_text(content)
    with pytest.raises(ValueError, match=match):
        prepare()


@pytest.mark.parametrize("algorithm", OF_ALGORITHM)
def test_a_training_writes_a_model_its_card_and_its_curve(
    algorithm: str, command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(algorithm, "--seed", "3")) == 0
    out = tmp_path / "out"
    names = {"model.zip", "model.json", "run.json", "curve.csv", "progress.json"}
    names |= {"best", "tensorboard"}
    assert {path.name for path in out.iterdir()} == names
    assert list((out / "tensorboard").glob("events.*"))
    model = loading.load(out)
    card = model.card
    assert (card.algorithm, card.seed, card.policy) == (algorithm, 3, "mlp")
    assert card.environment == TINY["env_kwargs"]
    assert card.settings["hyperparameters"]["learner"]["learning_rate"] == "lin_1e-3"
    assert [row["steps"] for row in card.curve] == [0, 32, 64, 96]
    assert [int(row["steps"]) for row in curve_of(out)] == [0, 32, 64, 96]
    for key, spec in (("chosen_on", CHOSEN), ("reported_on", REPORTED)):
        found = score(fly_batch(model, get_fields(spec)))
        assert card.results[key]["fields"] == spec
        assert card.results[key]["flights"] == 5
        assert card.results[key]["spl"] == found.spl
    assert max(row["spl"] for row in card.curve) == card.results["chosen_on"]["spl"]
    assert "SPL" in capsys.readouterr().out

    # the same command has nothing left to do
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert main(command(algorithm, "--seed", "3")) == 0
    assert "is already finished; --fresh starts over" in capsys.readouterr().err
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before


def test_the_same_seed_gives_the_same_model(command: Command, tmp_path: Path) -> None:
    found = []
    for seed in ("0", "0", "1"):
        assert main(command("ppo", "--seed", seed, "--fresh")) == 0
        found.append(weights_of(tmp_path / "out"))
    assert same(found[0], found[1])
    assert not same(found[0], found[2])


def press(monkeypatch: pytest.MonkeyPatch, at: int) -> None:
    """Ctrl-C during the evaluation after so many steps."""
    evaluate = TrainingRecord.evaluate

    def interrupted(self: TrainingRecord, model: Any, steps: int, *others: Any) -> Any:
        found = evaluate(self, model, steps, *others)
        if steps == at:
            signal.raise_signal(signal.SIGINT)
        return found

    monkeypatch.setattr(TrainingRecord, "evaluate", interrupted)


@pytest.mark.parametrize("algorithm", ["ppo", "tqc"])
def test_an_interrupted_training_resumes(
    algorithm: str,
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        press(patch, at=64)
        assert main(command(algorithm)) == 130
    assert capsys.readouterr().err.endswith("ferguson: interrupted\n")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    checkpoint = training_checkpoint.latest(out / "checkpoint")
    assert checkpoint is not None
    counts = training_checkpoint.counts_of(checkpoint)
    assert 64 <= counts.steps < 96
    assert counts.updates > 0
    assert not (out / "model.zip").exists()
    before = curve_of(out)
    assert [int(row["steps"]) for row in before] == [0, 32, 64]
    stopped = json.loads((out / "progress.json").read_text())
    assert (stopped["status"], stopped["steps"]) == ("stopped", counts.steps)
    assert stopped["model"] == str(out / "best")

    restored = []
    restore = training_checkpoint.restore

    def watched(place: Path, model: Any) -> None:
        restore(place, model)
        restored.append((model.num_timesteps, getattr(model, "replay_buffer", None)))

    monkeypatch.setattr(training_checkpoint, "restore", watched)
    assert main(command(algorithm)) == 0
    assert restored[0][0] == counts.steps
    if algorithm == "tqc":
        buffer = restored[0][1]
        assert buffer.full  # 64 steps of 4 environments
        assert np.abs(buffer.observations["rays"]).max() > 0.0
    after = curve_of(out)
    assert after[:3] == before
    assert int(after[-1]["steps"]) >= 96
    assert not (out / "checkpoint").exists()
    assert loading.load(out).card.curve[-1]["steps"] >= 96
    finished = json.loads((out / "progress.json").read_text())
    assert (finished["status"], finished["model"]) == ("finished", str(out))
    assert finished["validation"]["steps"] == finished["steps"] >= 96


def test_a_training_from_when_discs_were_the_default_resumes_with_discs(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, environment = tmp_path / "out", {"suite": "sparse", "fields": 20, "nearest": 3}
    with monkeypatch.context() as patch:
        press(patch, at=64)
        assert main(command("ppo", env_kwargs={**environment, "observation": "discs"})) == 130
    for file in (out / "run.json", out / "best/model.json"):  # as they were written then
        entries = json.loads(file.read_text())
        where: Any = entries.get("settings", entries)
        del where["hyperparameters"]["env_kwargs"]["observation"]
        entries.get("environment", {}).pop("observation", None)
        file.write_text(json.dumps(entries))
    assert main(command("ppo", env_kwargs=environment)) == 0
    card = loading.load(out).card
    assert card.environment == {**environment, "observation": "discs"}
    assert [row["steps"] for row in card.curve][:3] == [0, 32, 64]


def test_a_training_that_names_no_observation_sees_rays(command: Command, tmp_path: Path) -> None:
    assert main(command("ppo", env_kwargs={"suite": "sparse", "rays": 5})) == 0
    assert loading.load(tmp_path / "out").card.environment["observation"] == "rays"


def test_a_checkpoint_restores_networks_and_optimizers(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, read_back = [], []
    write, restore = training_checkpoint.write, training_checkpoint.restore

    def parts(model: Any) -> dict:
        # an optimizer's numbers as its networks' weights
        return {name: str(value) for name, value in model.get_parameters().items()} | {
            "updates": model._n_updates,
            "entropy": str(model.log_ent_coef),
        }

    def watched_write(place: Path, model: Any, seconds: float) -> None:
        written.append(parts(model))
        write(place, model, seconds)

    def watched_restore(place: Path, model: Any) -> None:
        restore(place, model)
        read_back.append(parts(model))

    monkeypatch.setattr(training_checkpoint, "write", watched_write)
    monkeypatch.setattr(training_checkpoint, "restore", watched_restore)
    with monkeypatch.context() as patch:
        press(patch, at=32)
        assert main(command("tqc")) == 130
    assert main(command("tqc")) == 0
    assert read_back[0] == written[0]


def test_a_damaged_checkpoint_is_refused_and_fresh_starts_over(
    command: Command,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with monkeypatch.context() as patch:
        press(patch, at=32)
        assert main(command("tqc")) == 130
    checkpoint = training_checkpoint.latest(tmp_path / "out/checkpoint")
    assert checkpoint is not None
    for name in ("buffer.npz", "model.zip", "state.json"):
        whole = (checkpoint / name).read_bytes()
        (checkpoint / name).write_bytes(whole[: len(whole) // 2])
        assert main(command("tqc")) == 2
        error = capsys.readouterr().err
        assert "the checkpoint " in error
        assert "cannot be read" in error
        assert "--fresh starts over" in error
        (checkpoint / name).write_bytes(whole)
    (checkpoint / "buffer.npz").unlink()
    assert main(command("tqc")) == 2
    assert main(command("tqc", "--fresh")) == 0
    assert next(iter(curve_of(tmp_path / "out")))["steps"] == "0"


def test_another_training_in_the_same_place_is_refused(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command("ppo")) == 0
    before = weights_of(tmp_path / "out")
    for algorithm, more, changes, match in (
        ("ppo", ["--seed", "1"], {}, "seed was 0, now 1"),
        ("tqc", [], {}, 'algorithm was "ppo", now "tqc"'),
        ("ppo", [], {"n_steps": 16}, "hyperparameters.learner.n_steps was 8, now 16"),
        ("ppo", [], {"gamma": 0.9}, "hyperparameters.learner.gamma was null, now 0.9"),
        ("ppo", ["--steps", "99"], {}, "steps was 96, now 99"),
    ):
        assert main(command(algorithm, *more, **changes)) == 2
        error = capsys.readouterr().err
        assert match in error
        assert "choose another --out, or start over with --fresh" in error
    assert same(before, weights_of(tmp_path / "out"))


def test_other_files_are_never_removed(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out/thesis.tex").write_text("all of it")
    for more in ((), ("--fresh",)):
        assert main(command("ppo", *more)) == 2
        assert "out holds other files; choose a new directory" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["thesis.tex"]


def test_a_training_starts_from_the_weights_of_another_model(
    command: Command, tmp_path: Path
) -> None:
    start = saved(tmp_path / "start", seed=7)  # 9 rays, 24 x 24
    # nothing is learned, so the weights stay
    assert main(command("ppo", "--from", str(start / "model.zip"), learning_rate=0.0)) == 0
    card = loading.load(tmp_path / "out").card
    assert card.environment == {**TINY["env_kwargs"], "rays": 9}
    assert card.policy_kwargs["net_arch"] == [24, 24]
    assert same(weights_of(start), weights_of(tmp_path / "out"))


def test_an_off_policy_training_starts_with_demonstrations_in_its_buffer(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flights = straight_flights(tmp_path)
    monkeypatch.setattr(reading, "read", {"far/away-v0": flights}.__getitem__)
    filled = []
    fill = demonstration_data.fill

    def watched(buffer: Any, *others: Any) -> int:
        filled.append((fill(buffer, *others), buffer.pos, buffer.rewards.max()))
        return int(filled[0][0])

    monkeypatch.setattr(demonstration_data, "fill", watched)
    assert main(command("tqc", "--demos", "far/away-v0")) == 0
    assert filled[0][:2] == (12, 3)  # rows of four environments
    assert filled[0][2] > 0.0
    assert loading.load(tmp_path / "out").card.settings["demos"] == "far/away-v0"
    # more than there is room for is refused before anything is removed
    assert main(command("tqc", "--demos", "far/away-v0", "--fresh", buffer_size=8)) == 2
    assert (tmp_path / "out/model.zip").exists()


@pytest.mark.parametrize(
    ("more", "changes", "match"),
    [
        ([], {"wings": 2}, "unknown keys 'wings'; known are n_envs"),
        ([], {"batch_size": 0.5}, "ppo refuses these hyperparameters"),
        ([], {"learning_rate": "lin_fast"}, "need a number after lin_, got 'lin_fast'"),
        ([], {"n_envs": 0}, "n_envs must be an integer >= 1, got 0"),
        ([], {"policy": "oracle"}, "unknown policy 'oracle'; policies are mlp"),
        ([], {"policy_kwargs": {"depth": 3}}, "unexpected keyword argument 'depth'"),
        ([], {"policy_kwargs": [8]}, "policy_kwargs must have keys and values, got [8]"),
        ([], {"env_kwargs": {"wind": 3}}, "unexpected keyword argument 'wind'; known are suite"),
        ([], {"env_kwargs": {"segments": 9}}, "leave `gate` and `segments` out"),
        ([], {"gamma": float("nan")}, "gamma must be a finite number, a word or a list, got nan"),
        (["--from", "nowhere"], {}, "--from nowhere: no such model"),
        (["--demos", "a/b-v0"], {}, "ppo cannot use --demos; tqc"),
        (["--minutes", "0"], {}, "need a positive number of minutes, got '0'"),
        (["--choose-on", "standard/moon:1"], {}, "moon"),
    ],
)
def test_invalid_runs_are_refused_before_anything_is_written(
    more: list[str],
    changes: dict,
    match: str,
    command: Command,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(command("ppo", *more, **changes)) == 2
    error = capsys.readouterr().err
    assert match in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_model_with_other_networks_is_refused_as_a_start(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = saved(tmp_path / "start")
    assert main(command("tqc", "--from", str(start))) == 2
    assert "tqc cannot start from a model of ppo" in capsys.readouterr().err
    assert main(["train", "ppo", "--out", str(start), "--from", str(start)]) == 2
    assert "is inside --out" in capsys.readouterr().err
    assert main(["train", "luck", "--out", str(tmp_path / "out")]) == 2
    known = "choose from ppo, tqc, bc, dagger"
    assert f"invalid choice: 'luck'; {known}" in capsys.readouterr().err
