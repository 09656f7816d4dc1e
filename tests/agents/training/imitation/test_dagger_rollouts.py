"""Visits: what an expert would do wherever a learner comes, and how flights go on."""

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
from agents.training.imitation.dagger_rollouts import Visit, somewhere, visit
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


def asked(**changes: Any) -> Visit:
    arguments: dict[str, Any] = {
        "card": CARD,
        "weights": weights(),
        "expert": "pursuit",
        "seeds": SEEDS,
        "stream": (0, 1, 2),
        "scattered": 0.5,
        **changes,
    }
    return Visit(**arguments)


def states_of(rows: Array) -> list[State]:
    return [State(row[1:3], row[3:5], int(row[5])) for row in rows]


def test_the_same_visit_gives_the_same_rows() -> None:
    found = visit(asked())
    again = visit(asked())
    assert found.rows.shape == (found.steps, COLUMNS)
    np.testing.assert_array_equal(again.rows, found.rows)
    assert (again.steps, again.failures) == (found.steps, found.failures)
    for change in ({"weights": weights(1)}, {"stream": (0, 1, 3)}, {"seeds": range(40, 44)}):
        other = visit(asked(**change))
        assert other.rows.shape != found.rows.shape or (other.rows != found.rows).any()
    # and what others asked for in between has left nothing behind
    np.testing.assert_array_equal(visit(asked()).rows, found.rows)


def test_the_threads_of_torch_are_those_it_had() -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2)
        visit(asked(seeds=range(30, 31)))
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


@pytest.mark.slow
def test_the_same_visit_in_another_process_gives_the_same_rows() -> None:
    (there,) = Parallel(n_jobs=2)(delayed(visit)(one) for one in [asked()])
    np.testing.assert_array_equal(there.rows, visit(asked()).rows)


def test_rows_are_what_the_expert_decides_wherever_the_learner_comes() -> None:
    found = visit(asked(scattered=0.0))
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
            lesson = encode(chain[0], vehicle.position, vehicle.derivative)
            np.testing.assert_array_equal(np.float32(row[6:10]), lesson)
            seen = observe_one(field, vehicle, CARD_SETTINGS)
            action = network.act({key: value[None] for key, value in seen.items()})[0]
            step = transition.advance(field, vehicle, action)
            if not step.flown:
                failures += 1
                assert row[10] == 1.0
                step = transition.advance(field, vehicle, lesson)
                assert step.flown
            vehicle, outcome = step.state, step.outcome
        assert outcome is not Outcome.FLYING
    # a learner that knows nothing is refused now and then, and yet flights go on
    assert failures == found.failures > 2
    assert len(found.rows) > 2 * len(SEEDS)


def test_a_learner_that_is_always_refused_sees_the_expert_s_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # 2.4 m are too short anywhere
    back = np.array([-1.0, 0.0, 0.0, 0.0], np.float32)
    monkeypatch.setattr(CompiledNetwork, "act", lambda self, seen: back[None])
    found = visit(asked(scattered=0.0))
    assert found.failures == found.steps == len(found.rows)
    assert (found.rows[:, 10] == 1.0).all()
    for seed in SEEDS:
        field = CARD_SETTINGS.field(seed)
        plan = make("pursuit").plan(field, interface.initial_state(field), 0)
        rows = found.rows[found.rows[:, 0] == seed]
        assert len(rows) == len(plan.control)
        np.testing.assert_array_equal(rows[:, 1:3], plan.control[:, 0])


class _Lost:
    """An expert that never knows a way."""

    limits = make("pursuit").limits  # type: ignore[attr-defined]

    def decide(self, *_: object) -> Decision:
        return Decision(None, interface.WindowReport(step=0, seconds=0.0))


def test_where_the_expert_knows_nothing_there_is_no_lesson_and_a_refusal_ends_the_flight(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("agents.training.imitation.dagger_rollouts._expert", lambda name: _Lost())
    found = visit(asked(scattered=0.0))
    assert found.rows.shape == (0, COLUMNS)
    assert found.steps >= len(SEEDS)
    assert found.failures <= len(SEEDS)


def test_a_visit_of_no_fields_is_empty() -> None:
    found = visit(asked(seeds=range(5, 5)))
    assert (found.rows.shape, found.steps, found.failures) == ((0, COLUMNS), 0, 0)


def test_as_many_flights_as_asked_for_begin_anywhere() -> None:
    starts = {}
    for scattered in (0.0, 0.5, 1.0):
        rows = visit(asked(scattered=scattered, seeds=range(100, 116))).rows
        first = np.flatnonzero(np.diff(rows[:, 0], prepend=-1))
        starts[scattered] = float((np.abs(rows[first, 1:3]).max(axis=1) > 0.0).mean())
    assert starts[0.0] == 0.0
    assert 0.2 < starts[0.5] < 0.8
    assert starts[1.0] == 1.0


def test_somewhere_is_free_inside_the_bounds_and_on_some_way() -> None:
    stream = np.random.default_rng(0)
    towards, flown = [], []
    for name in ("dense/train:0", "traps/train:0"):
        field = get_field(name)
        for _ in range(40):
            vehicle = somewhere(field, stream)
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


CARD_SETTINGS = settings_of(CARD.environment)
