"""`ferguson demos`: datasets that Minari reads, replayed exactly, and read back by learners."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.cli.main import main
from agents.demonstrations.reading import read
from tests.support.waiting import until

minari = pytest.importorskip("minari")
h5py = pytest.importorskip("h5py")

ID = "ferguson/guided-v0"


@pytest.fixture
def root(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where datasets lie."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    return tmp_path


def demos(*more: str, fields: str = "sparse/train:0-3", out: str = ID) -> int:
    arguments = {"--expert": "guided", "--fields": fields, "--out": out}
    for name, value in zip(more[::2], more[1::2], strict=False):
        arguments.pop(name, value)
    return main(["demos", *(word for pair in arguments.items() for word in pair), *more])


def content(dataset_id: str) -> list[Any]:
    """Everything in a dataset's episodes, as plain values."""
    dataset = minari.load_dataset(dataset_id)
    notes = dataset.storage.get_episode_metadata(dataset.episode_indices)
    return [
        (
            dict(note["options"]),
            note.get("seed"),
            episode.actions.tolist(),
            {key: values.tolist() for key, values in episode.observations.items()},
            {key: values.tolist() for key, values in episode.infos.items()},
            episode.rewards.tolist(),
            episode.terminations.tolist(),
            episode.truncations.tolist(),
        )
        for note, episode in zip(notes, dataset.iterate_episodes(), strict=True)
    ]


@pytest.mark.parametrize("more", [(), ("--observation", "rays", "--rays", "16")])
def test_the_recovered_environment_replays_every_transition(
    root: Path, more: Sequence[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert demos(*more) == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(r"4 flights, \d+ steps\n", out)
    assert err == f"wrote dataset {ID} to {root / ID}\n"
    dataset = minari.load_dataset(ID)
    env = dataset.recover_environment()
    notes = list(dataset.storage.get_episode_metadata(dataset.episode_indices))
    assert [note["options"]["field"] for note in notes] == [f"sparse/train:{k}" for k in range(4)]
    for note, episode in zip(notes, dataset.iterate_episodes(), strict=True):
        # the options, or the seed alone
        for given in ({"options": note["options"]}, {"seed": note["seed"]}):
            observation, info = env.reset(**given)
            for step in range(len(episode) + 1):
                for key, values in episode.observations.items():
                    np.testing.assert_array_equal(observation[key], values[step])
                    assert observation[key].dtype == values.dtype
                assert info == {key: values[step] for key, values in episode.infos.items()}
                if step < len(episode):
                    observation, *told, info = env.step(episode.actions[step])
                    assert told == [
                        episode.rewards[step],
                        episode.terminations[step],
                        episode.truncations[step],
                    ]
        assert episode.terminations[-1]
        assert not episode.truncations.any()


def test_flat_demonstrations_are_vectors_and_are_read(root: Path) -> None:
    assert demos("--flat", fields="sparse/train:0-1") == 0
    dataset = minari.load_dataset(ID)
    space = dataset.recover_environment().observation_space
    assert dataset.observation_space == space
    for episode in dataset.iterate_episodes():
        assert episode.observations.shape == (len(episode.actions) + 1, *space.shape)
        assert all(row in space for row in episode.observations)
    assert read(ID).environment["flat"] is True


def test_the_metadata_hold_the_request_and_versions(root: Path) -> None:
    assert demos("--expert", "single-start", fields="standard/train:0-5") == 0
    dataset = minari.load_dataset(ID)
    metadata = dataset.storage.metadata
    assert metadata["algorithm_name"] == "single-start"
    assert metadata["ref_min_score"] < 0.0 < metadata["ref_max_score"] <= 1.0
    assert metadata["num_episodes_average_score"] == 6
    assert dataset.env_spec.id == "ferguson/ObstacleField-v0"
    told = metadata["demonstrations"]
    assert told["expert"] == "single-start"
    assert told["fields"] == ["standard/train:0-5"]
    assert told["environment"]["arguments"] == {
        "suite": "standard",
        "split": "train",
        "observation": "rays",
    }
    assert {"python", "ferguson-gym", "numpy"} <= set(told["versions"])
    assert set(told) >= {"commit", "flights", "failed"}
    # failed flights are left out and counted
    assert told["flights"] == len(dataset) < 6
    assert len(told["failed"]) == 6 - len(dataset)
    normalized = minari.get_normalized_score(
        dataset, np.array([episode.rewards.sum() for episode in dataset.iterate_episodes()])
    )
    assert normalized.mean() == pytest.approx(1.0)


def test_the_work_directory_is_removed(root: Path) -> None:
    assert demos() == 0
    assert not list(root.rglob(".*"))
    assert list(minari.list_local_datasets()) == [ID]


@pytest.mark.slow
def test_workers_and_interruptions_do_not_change_the_dataset(root: Path) -> None:
    fields = "sparse/train:0-79"
    command = [sys.executable, "-m", "agents.cli.main", "demos", "--expert", "guided"]
    command += ["--fields", fields, "--out", ID]
    work = root / "ferguson" / ".guided-v0.part"
    for stop, status in ((signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)):
        before = len(list(work.glob("chunk-*")))
        run = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        assert until(lambda: len(list(work.glob("chunk-*"))) > before, 60.0)  # noqa: B023
        run.send_signal(stop)
        _, said = run.communicate()
        assert run.returncode == status, said
        assert not (root / ID).exists()
    assert "run the same command again to resume" in said
    assert "Traceback" not in said
    assert 2 <= len(list(work.glob("chunk-*"))) < 8
    assert demos("--workers", "2", fields=fields) == 0
    assert demos(fields=fields, out="ferguson/other-v0") == 0
    assert content(ID) == content("ferguson/other-v0")


def test_writing_resumes_after_an_interruption(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from agents.demonstrations import minari_store

    def stopped(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(minari_store, "_register_namespace", stopped)
    assert demos() == 130
    assert list(minari.list_local_datasets()) == []
    monkeypatch.undo()
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    assert demos() == 0
    assert len(content(ID)) == 4


def test_an_existing_dataset_is_refused_or_replaced(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demos() == 0
    before = content(ID)
    assert demos(fields="sparse/train:0-1") == 2
    assert "there is a dataset ferguson/guided-v0 at" in capsys.readouterr().err
    assert content(ID) == before
    again = ["demos", "--expert", "guided", "--fields", "sparse/train:0-1", "--out", ID]
    assert main([*again, "--fresh"]) == 0
    assert content(ID) == before[:2]


def test_without_a_success_there_is_no_dataset(
    root: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demos("--expert", "single-start", fields="traps/train:0-1") == 1
    assert "no demonstrations: 0 flights" in capsys.readouterr().err
    assert list(minari.list_local_datasets()) == []
    assert not list(root.rglob(".*"))


def test_learners_read_fields_and_actions(root: Path) -> None:
    assert demos() == 0
    read_back = read(ID)
    dataset = minari.load_dataset(ID)
    assert len(read_back) == 4
    assert read_back.expert == "guided"
    assert read_back.fields == tuple(f"sparse/train:{k}" for k in range(4))
    assert read_back.environment["suite"] == "sparse"
    assert read_back.offsets[-1] == len(read_back.actions) == dataset.total_steps
    for i, episode in enumerate(dataset.iterate_episodes()):
        np.testing.assert_array_equal(read_back.flight(i), episode.actions)


def test_an_unknown_dataset_is_refused_and_known_ones_are_listed(root: Path) -> None:
    with pytest.raises(ValueError, match=r"no dataset nobody-v0 at .*; existing datasets: none"):
        read("nobody-v0")
    assert demos() == 0
    with pytest.raises(ValueError, match=f"no dataset nobody-v0 at .*; existing datasets: {ID}"):
        read("nobody-v0")


def edit(root: Path, key: str, value: object) -> None:
    place = root / ID / "data" / "metadata.json"
    metadata = json.loads(place.read_text())
    metadata[key] = value
    if value is None:
        del metadata[key]
    place.write_text(json.dumps(metadata))


def test_datasets_of_other_programs_are_refused(root: Path) -> None:
    assert demos() == 0
    place = root / ID / "data" / "metadata.json"
    kept = place.read_text()
    edit(root, "demonstrations", None)
    with pytest.raises(ValueError, match="need demonstrations in ferguson/ObstacleField-v0"):
        read(ID)
    place.write_text(kept)
    spec = json.loads(json.loads(kept)["env_spec"])
    edit(root, "env_spec", json.dumps(spec | {"id": "ferguson/ObstacleField-v7"}))
    with pytest.raises(ValueError, match="is of ferguson/ObstacleField-v7; need demonstrations in"):
        read(ID)


@pytest.mark.parametrize("what", ["rewards", "actions"])
def test_a_dataset_of_another_version_of_the_environment_is_refused(root: Path, what: str) -> None:
    assert demos() == 0
    with h5py.File(root / ID / "data" / "main_data.hdf5", "a") as file:
        file["episode_3"][what][1] *= 0.9
    with pytest.raises(ValueError, match="recorded with another version of the environment"):
        read(ID)


@pytest.mark.parametrize("keep", [0, 100, 20_000])
def test_a_truncated_dataset_is_refused(root: Path, keep: int) -> None:
    assert demos() == 0
    place = root / ID / "data" / "main_data.hdf5"
    place.write_bytes(place.read_bytes()[:keep])
    with pytest.raises(ValueError, match=f"dataset {ID} is damaged or cannot be read"):
        read(ID)


def test_a_dataset_that_lost_flights_is_refused(root: Path) -> None:
    assert demos() == 0
    with h5py.File(root / ID / "data" / "main_data.hdf5", "a") as file:
        del file["episode_3"]
    with pytest.raises(ValueError, match=f"dataset {ID} is damaged or cannot be read"):
        read(ID)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda told: told["demonstrations"].pop("expert"), r"is damaged .* \('expert'\)"),
        (lambda told: told.update(demonstrations=3), "is damaged or cannot be read"),
        (lambda told: told["demonstrations"].update(flights="4"), "4 flights instead of 4"),
        (lambda told: told.update(env_spec=told["env_spec"].replace("suite", "wind")), "wind"),
    ],
)
def test_a_dataset_without_its_expert_is_refused(root: Path, change: Any, match: str) -> None:
    assert demos() == 0
    place = root / ID / "data" / "metadata.json"
    told = json.loads(place.read_text())
    change(told)
    place.write_text(json.dumps(told))
    with pytest.raises(ValueError, match=match):
        read(ID)


def test_invalid_actions_are_refused(root: Path) -> None:
    assert demos() == 0
    with h5py.File(root / ID / "data" / "main_data.hdf5", "a") as file:
        file["episode_1"]["actions"][1, 2] = np.nan
    with pytest.raises(ValueError, match=r"actions outside \[-1, 1\]"):
        read(ID)


def test_arrays_that_claim_to_be_larger_than_their_file_are_not_read(root: Path) -> None:
    assert demos() == 0
    with h5py.File(root / ID / "data" / "main_data.hdf5", "a") as file:
        episode = file["episode_2"]
        del episode["actions"]
        episode.create_dataset("actions", (10**10, 4), np.float32, chunks=(1000, 4))
    with pytest.raises(ValueError, match=r"actions has 160,000,000,000 bytes, and the file"):
        read(ID)
