"""Flying demonstrations: exact, the same for any number of workers, resumed where they stopped."""

import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gymnasium.spaces import flatten

from agents.demonstrations import recording as making
from agents.demonstrations import work
from agents.demonstrations.episode import Episode, make_environment, pack, replay, unpack
from agents.demonstrations.work import Request
from ferguson_gym.curves.path import Path as Flown
from ferguson_gym.world.outcome import Outcome
from planners.interface import initial_state
from planners.registry import make
from tests.support.waiting import until

SOFTWARE = {"versions": {}, "commit": None}


def wanted(
    *specs: str, expert: str = "guided", observation: str = "discs", **arguments: int
) -> Request:
    return Request(
        expert=expert,
        specs=specs or ("sparse/train:0-3",),
        arguments={"observation": observation, **arguments},
        software=SOFTWARE,
    )


def fly_all(place: Path, request: Request, workers: int = 1) -> list[Episode]:
    store = work.open_store(place, request)
    missing = store.begin()
    assert sum(work.fly(store, request, missing, workers)) == sum(
        len(request.chunk(number)) for number in missing
    )
    return list(work.flown(store))


def assert_same(one: Episode, other: Episode) -> None:
    """Bit for bit."""
    assert one.field == other.field
    assert one.outcome is other.outcome
    for name in ("actions", "rewards", "terminations", "truncations"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.dtype == b.dtype
        np.testing.assert_array_equal(a, b)
    for name in ("observations", "infos"):
        a, b = getattr(one, name), getattr(other, name)
        assert a.keys() == b.keys()
        for key in a:
            assert a[key].dtype == b[key].dtype
            np.testing.assert_array_equal(a[key], b[key])


@pytest.mark.parametrize("observation", ["discs", "rays"])
def test_replayed_actions_reproduce_every_transition(tmp_path: Path, observation: str) -> None:
    request = wanted("sparse/train:0-3", "paper:1", observation=observation)
    episodes = fly_all(tmp_path / "work", request)
    env = make_environment(request.environment)
    for episode, name in zip(episodes, request.fields, strict=True):
        assert episode.field == name
        assert episode.outcome is Outcome.GOAL_REACHED
        assert episode.infos["is_success"].tolist() == [False] * len(episode.actions) + [True]
        assert_same(replay(env, name, episode.actions), episode)


def test_flat_observations_are_those_of_the_dictionary_in_one_vector(tmp_path: Path) -> None:
    flat = replace(wanted("sparse/train:2"), arguments={"observation": "discs", "flat": True})
    (episode,) = fly_all(tmp_path / "flat", flat)
    (other,) = fly_all(tmp_path / "entries", wanted("sparse/train:2"))
    space = make_environment({"observation": "discs"}).observation_space
    rows = [
        flatten(space, {key: values[k] for key, values in other.observations.items()})
        for k in range(len(other.actions) + 1)
    ]
    np.testing.assert_array_equal(episode.observations["flat"], np.stack(rows))
    assert_same(
        replay(make_environment(flat.environment), "sparse/train:2", episode.actions), episode
    )


def test_a_demonstration_is_the_experts_flight(tmp_path: Path) -> None:
    (episode,) = fly_all(tmp_path / "work", wanted("sparse/train:2"))
    env = make_environment({"observation": "discs"})
    observation, _ = env.reset(options={"field": "sparse/train:2"})
    np.testing.assert_array_equal(episode.observations["goal"][0], observation["goal"])
    inside = env.unwrapped
    plan = make("guided").plan(inside.field, initial_state(inside.field), 0)
    for action in episode.actions:
        env.step(action)
    np.testing.assert_array_equal(inside.control, plan.control)
    assert episode.infos["path_length"][-1] == pytest.approx(Flown(plan.control).length)


def test_seeds_alone_recover_the_fields_of_one_suite_and_split(tmp_path: Path) -> None:
    request = wanted("dense/validation:7")
    assert request.environment["suite"] == "dense"
    assert request.environment["split"] == "validation"
    (episode,) = fly_all(tmp_path / "work", request)
    observation, _ = make_environment(request.environment).reset(seed=7)
    for key, values in observation.items():
        np.testing.assert_array_equal(values, episode.observations[key][0])


def test_fields_of_several_suites_have_no_suite_in_common() -> None:
    request = wanted("dense/train:0", "sparse/train:0")
    assert "suite" not in request.environment
    assert "split" not in wanted("paper:1-4").environment


def test_the_number_of_workers_does_not_change_the_episodes(tmp_path: Path) -> None:
    request = wanted("sparse/train:0-14")
    alone = fly_all(tmp_path / "one", request)
    together = fly_all(tmp_path / "two", request, workers=2)
    assert [episode.field for episode in alone] == request.fields
    for one, other in zip(alone, together, strict=True):
        assert_same(one, other)


def test_a_killed_run_resumes_where_it_stopped(tmp_path: Path) -> None:
    request, place = wanted("sparse/train:0-199"), tmp_path / "work"
    program = (
        "import sys; from pathlib import Path; from agents.demonstrations import work\n"
        "request = work.Request(expert='guided', specs=('sparse/train:0-199',), "
        "arguments={'observation': 'discs'}, software={'versions': {}, 'commit': None})\n"
        "store = work.open_store(Path(sys.argv[1]), request)\n"
        "list(work.fly(store, request, store.begin(), 1))"
    )
    run = subprocess.Popen([sys.executable, "-c", program, str(place)])
    try:
        assert until(lambda: len(list(place.glob("chunk-*"))) >= 1, 60.0)
    finally:
        run.kill()
        run.wait()
    assert run.returncode == -signal.SIGKILL
    kept = {path: path.stat().st_mtime_ns for path in place.glob("chunk-*")}
    missing = work.open_store(place, request).begin()
    assert 0 < len(missing) == 20 - len(kept)
    resumed = fly_all(place, request)
    assert {path: path.stat().st_mtime_ns for path in kept} == kept  # not flown again
    for one, other in zip(resumed, fly_all(tmp_path / "whole", request), strict=True):
        assert_same(one, other)


def test_failed_flights_are_counted_by_outcome(tmp_path: Path) -> None:
    request = wanted("standard/train:0-5", expert="single-start")
    episodes = fly_all(tmp_path, request)
    tally = making.count(work.open_store(tmp_path, request))
    good = [episode for episode in episodes if episode.outcome.success]
    assert 0 < len(good) < 6
    assert tally.flights == len(good)
    assert tally.steps == sum(len(episode.actions) for episode in good)
    assert tally.mean_return == pytest.approx(np.mean([e.rewards.sum() for e in good]))
    assert tally.failed == {
        episode.field: episode.outcome.label for episode in episodes if not episode.outcome.success
    }
    assert f"{6 - len(good)} failed and left out" in tally.sentence()


def test_episodes_are_packed_and_unpacked_even_those_without_a_step(tmp_path: Path) -> None:
    episodes = fly_all(tmp_path, wanted("sparse/train:0-1"))
    env = make_environment({"observation": "discs"})
    none = replace(replay(env, "sparse/train:5", episodes[0].actions[:0]), field="sparse/train:5")
    assert none.outcome is Outcome.GAVE_UP
    given = [episodes[0], none, episodes[1]]
    for one, other in zip(given, unpack(pack(given)), strict=True):
        assert_same(one, other)


def test_random_actions_score_below_the_expert_and_reproducibly(tmp_path: Path) -> None:
    request = wanted()
    fly_all(tmp_path, request)
    score = making.random_return(request.environment, request.fields)
    assert score == making.random_return(request.environment, request.fields)
    assert score < 0.0 < 0.7 < making.count(work.open_store(tmp_path, request)).mean_return


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (wanted(expert="multi-start"), 'expert was "guided", now "multi-start"'),
        (wanted("sparse/train:0-4"), r"fields was \[.*0-3.*\], now \[.*0-4.*\]"),
        (
            wanted(observation="rays"),
            r"observation was .*discs.*, now .*rays",
        ),
        (replace(wanted(), software={"versions": {}, "commit": "abc"}), 'now "abc"'),
    ],
)
def test_the_work_of_another_request_is_refused(
    tmp_path: Path, other: Request, message: str
) -> None:
    work.open_store(tmp_path, wanted()).begin()
    with pytest.raises(ValueError, match=f"{message}.*start over with --fresh"):
        work.open_store(tmp_path, other).begin()
    assert work.open_store(tmp_path, wanted()).begin() == [0]


def test_a_run_without_a_finished_chunk_resumes(tmp_path: Path) -> None:
    (tmp_path / ".writing-request").touch()
    assert work.open_store(tmp_path, wanted()).begin() == [0]


def test_a_directory_without_work_is_refused(tmp_path: Path) -> None:
    (tmp_path / "request.json").write_text("[")
    with pytest.raises(ValueError, match=r"does not say how it was made; .*start over"):
        work.open_store(tmp_path, wanted()).begin()


def test_a_damaged_chunk_is_named(tmp_path: Path) -> None:
    request = wanted()
    fly_all(tmp_path, request)
    (chunk,) = tmp_path.glob("chunk-*")
    chunk.write_bytes(chunk.read_bytes()[:3000])
    with pytest.raises(OSError, match=rf"{chunk.name} is damaged .*: remove it, and run again"):
        list(work.flown(work.open_store(tmp_path, request)))
    chunk.unlink()
    assert len(fly_all(tmp_path, request)) == 4


@pytest.mark.parametrize(
    ("specs", "message"),
    [
        (("sparse/train:0-3", "sparse/train:3"), "name a field twice"),
        (("jungle/train:0",), "unknown suite 'jungle'"),
        (("standard/train:0-1000000",), "at most 1000000 fields, not 1000001"),
    ],
)
def test_invalid_fields_are_refused(specs: tuple[str, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        wanted(*specs)


def test_fields_from_files_are_refused(tmp_path: Path) -> None:
    place = tmp_path / "mine.json"
    place.write_text(json.dumps({"centers": [[50.0, 50.0]], "radii": [3.0]}))
    with pytest.raises(ValueError, match="is a file, which may change"):
        wanted(str(place))
