"""Rollouts of DAgger: expert labels in the states that a learner visits."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch
from joblib import Parallel, delayed

from agents.models import torch_model
from agents.models.inference.forward import CompiledNetwork
from agents.models.model_card import ModelCard
from agents.models.torch_model import TorchModel
from agents.training.imitation.dagger_rollouts import RolloutRequest, collect, random_state
from agents.training.imitation.dataset import COLUMNS
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world import transition
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.outcome import Outcome
from ferguson_gym.world.transition import State
from planners import interface
from planners.interface import Decision, Replanner
from planners.registry import make
from tests.support.scaled_fields import Motion

CARD = ModelCard(
    algorithm="dagger",
    policy="mlp-mixture",
    policy_kwargs={"net_arch": [16], "components": 2},
    environment={"suite": "standard", "observation": "both", "nearest": 4, "rays": 7},
)
SEEDS = range(30, 34)


def weights(seed: int = 0) -> dict[str, Any]:
    torch.manual_seed(seed)
    return torch_model.build(CARD).state_dict()


def request(**changes: Any) -> RolloutRequest:
    arguments: dict[str, Any] = {
        "card": CARD,
        "environment": CARD.environment,
        "weights": weights(),
        "expert": "pursuit",
        "seeds": SEEDS,
        "stream": (0, 1, 2),
        "scattered": 0.5,
        **changes,
    }
    return RolloutRequest(**arguments)


def states_of(rows: Array) -> list[State]:
    return [State(row[1:3], row[3:5], int(row[5])) for row in rows]


def test_the_same_request_gives_the_same_rows() -> None:
    found = collect(request())
    again = collect(request())
    assert found.rows.shape == (found.steps, COLUMNS)
    np.testing.assert_array_equal(again.rows, found.rows)
    assert (again.steps, again.refused) == (found.steps, found.refused)
    for change in ({"weights": weights(1)}, {"stream": (0, 1, 3)}, {"seeds": range(40, 44)}):
        other = collect(request(**change))
        assert other.rows.shape != found.rows.shape or (other.rows != found.rows).any()
    # and requests in between leave no state behind
    np.testing.assert_array_equal(collect(request()).rows, found.rows)


def test_the_number_of_torch_threads_is_restored() -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2)
        collect(request(seeds=range(30, 31)))
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


@pytest.mark.slow
def test_another_process_gives_the_same_rows() -> None:
    (there,) = Parallel(n_jobs=2)(delayed(collect)(one) for one in [request()])
    np.testing.assert_array_equal(there.rows, collect(request()).rows)


def test_rows_hold_the_expert_s_decision_in_every_visited_state() -> None:
    found = collect(request(scattered=0.0))
    policy, planner = torch_model.build(CARD), make("pursuit")
    assert isinstance(planner, Replanner)
    policy.load_state_dict(weights())
    network = TorchModel(policy, CARD).model.network
    failures = 0
    assert sorted(set(found.rows[:, 0])) == list(SEEDS)
    for seed in SEEDS:
        field = CARD_SETTINGS.field(seed)
        rows = found.rows[found.rows[:, 0] == seed]
        vehicle, outcome = transition.initial_state(field), Outcome.FLYING
        for state, row in zip(states_of(rows), rows, strict=True):
            assert outcome is Outcome.FLYING
            np.testing.assert_array_equal(state.position, vehicle.position)
            np.testing.assert_array_equal(state.derivative, vehicle.derivative)
            assert state.segments == vehicle.segments
            chain = planner.decide(field, interface.State(vehicle), 0).chain
            assert chain is not None
            label = encode(chain[0], vehicle.position, vehicle.derivative)
            np.testing.assert_array_equal(np.float32(row[6:10]), label)
            seen = observe_one(field, vehicle, CARD_SETTINGS)
            action = network.act({key: value[None] for key, value in seen.items()})[0]
            step = transition.advance(field, vehicle, action)
            if not step.flown:
                failures += 1
                assert row[10] == 1.0
                step = transition.advance(field, vehicle, label)
                assert step.flown
            vehicle, outcome = step.state, step.outcome
        assert outcome is not Outcome.FLYING
    # segments of an untrained learner are refused now and then, and flights continue
    assert failures == found.refused > 2
    assert len(found.rows) > 2 * len(SEEDS)


def test_a_learner_that_is_always_refused_flies_the_expert_s_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # 2.4 m are too short anywhere
    back = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
    monkeypatch.setattr(CompiledNetwork, "act", lambda self, seen: back[None])
    found = collect(request(scattered=0.0))
    assert found.refused == found.steps == len(found.rows)
    assert (found.rows[:, 10] == 1.0).all()
    for seed in SEEDS:
        field = CARD_SETTINGS.field(seed)
        plan = make("pursuit").plan(field, interface.initial_state(field), 0)
        rows = found.rows[found.rows[:, 0] == seed]
        assert len(rows) == len(plan.control)
        np.testing.assert_array_equal(rows[:, 1:3], plan.control[:, 0])


class _Lost:
    """An expert that finds no path anywhere."""

    def decide(self, *_: object) -> Decision:
        return Decision(None, interface.WindowReport(step=0, seconds=0.0))


def test_without_a_label_there_is_no_row_and_a_refused_segment_ends_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("agents.training.imitation.dagger_rollouts._planner", lambda name: _Lost())
    found = collect(request(scattered=0.0))
    assert found.rows.shape == (0, COLUMNS)
    assert found.steps >= len(SEEDS)
    assert found.refused <= len(SEEDS)


def test_a_request_without_fields_is_empty() -> None:
    found = collect(request(seeds=range(5, 5)))
    assert (found.rows.shape, found.steps, found.refused) == ((0, COLUMNS), 0, 0)


def test_the_share_of_random_starts_is_as_requested() -> None:
    starts = {}
    for scattered in (0.0, 0.5, 1.0):
        rows = collect(request(scattered=scattered, seeds=range(100, 116))).rows
        first = np.flatnonzero(np.diff(rows[:, 0], prepend=-1))
        starts[scattered] = float((np.abs(rows[first, 1:3]).max(axis=1) > 0.0).mean())
    assert starts[0.0] == 0.0
    assert 0.2 < starts[0.5] < 0.8
    assert starts[1.0] == 1.0


def test_random_states_are_free_inside_the_bounds_and_head_for_the_goal() -> None:
    stream = np.random.default_rng(0)
    towards, flown = [], []
    for name in ("dense/train:0", "traps/train:0"):
        field = get_field(name)
        for _ in range(40):
            vehicle = random_state(field, stream)
            assert field.obstacles.signed_distance(vehicle.position).min() >= 0.0
            assert (vehicle.position >= field.bounds[0]).all()
            assert (vehicle.position <= field.bounds[1]).all()
            assert 3.0 < np.linalg.norm(vehicle.derivative) < 15.0
            assert 0 <= vehicle.segments < 20
            way = field.goal - vehicle.position
            towards.append(
                vehicle.derivative @ way / np.linalg.norm(way) / np.linalg.norm(vehicle.derivative)
            )
            flown.append((vehicle.segments, float(np.linalg.norm(way))))
    assert np.mean(towards) > 0.5
    assert min(towards) < 0.5  # some are astray
    # the nearer to the goal, the more is taken to have been flown
    assert np.corrcoef(np.array(flown).T)[0, 1] < -0.8


@pytest.mark.parametrize("scale", [0.01, 50.0])
def test_random_states_are_of_the_field_s_scale(scale: float) -> None:
    field = get_field("standard/train:0")
    image = Motion(scale=scale).field(field)
    for seed in range(10):
        one = random_state(field, np.random.default_rng(seed))
        other = random_state(image, np.random.default_rng(seed))
        np.testing.assert_allclose(other.position, scale * one.position, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(other.derivative, scale * one.derivative, rtol=1e-6)
        assert other.segments == one.segments < field.limits.segments


def test_a_refusal_without_a_label_marks_the_states_before_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    short = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
    ahead = np.zeros(4, np.float32)

    def knows_the_first(flights: Any) -> tuple[np.ndarray, np.ndarray]:
        number = len(flights.active)
        return np.tile(ahead, (number, 1)), flights.buffers.flights["segments"] == 0

    monkeypatch.setattr("agents.training.imitation.way_expert.label", knows_the_first)
    flown = [ahead, short]

    def act(self: Any, seen: Any) -> np.ndarray:
        return np.tile(flown.pop(0), (len(seen["goal"]), 1))

    monkeypatch.setattr(CompiledNetwork, "act", act)
    found = collect(request(scattered=0.0, seeds=range(30, 31), expert="way"))
    assert (found.steps, found.refused) == (2, 1)
    assert found.rows[:, 10].tolist() == [1.0]


CARD_SETTINGS = settings_of(CARD.environment)
