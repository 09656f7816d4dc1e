"""Cloning: what an update moves, in which world, and how it goes on."""

import copy
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch

from agents.models import torch_model
from agents.models.model_card import ModelCard
from agents.training.imitation.behavior_cloning import AVERAGED, BehaviorCloning
from agents.training.imitation.dataset import ImitationDataset, ImitationSample, row
from agents.training.imitation.mirror import mirrored
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world.actions import encode
from ferguson_gym.world.field_names import get_field, get_fields
from planners.interface import initial_state
from planners.receding_horizon.pursuit import Pursuit

CARD = ModelCard(
    algorithm="dagger",
    policy="deepsets-mixture",
    policy_kwargs={"net_arch": [16], "components": 2, "log_std_init": -1.5},
    environment={"observation": "both", "nearest": 3, "rays": 5},
)


@pytest.fixture(scope="module")
def lessons() -> ImitationDataset:
    known = ImitationDataset(settings_of(CARD.environment))
    for field in get_fields("dense/train:0-2"):
        plan = Pursuit().plan(field, initial_state(field), 0)
        rows = []
        for state, control in zip(plan.states, plan.control, strict=False):
            vehicle = state.vehicle
            action = encode(control, vehicle.position, vehicle.derivative)
            rows.append(row(int(field.name.partition(":")[2]), vehicle, action))
        known.add(np.array(rows), lambda seed: get_field(f"dense/train:{seed}"))
    return known


def drawn(lessons: ImitationDataset, number: int = 32) -> ImitationSample:
    return lessons.draw(np.random.default_rng(0), number, 0.0)


def cloner(rate: float = 1e-2, price: float = 8.0) -> BehaviorCloning:
    torch.manual_seed(0)
    policy: Any = torch_model.build(CARD)
    return BehaviorCloning(policy, lambda: rate, price)


def weights(policy: Any) -> list[torch.Tensor]:
    return [weight.detach().clone() for weight in policy.parameters()]


def same(one: list[torch.Tensor], other: list[torch.Tensor]) -> bool:
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def test_an_update_in_the_mirror_is_one_with_the_mirrored_lesson(lessons: ImitationDataset) -> None:
    lesson = drawn(lessons)
    seen, actions = mirrored(lesson.seen, lesson.actions)
    image = lesson.discs.clone()
    image[:, :, 1] *= -1.0
    by_hand = ImitationSample(seen, actions, image, lesson.present)
    found = [
        cloner().update(lesson, in_the_mirror=True),
        cloner().update(by_hand, in_the_mirror=False),
        cloner().update(lesson, in_the_mirror=False),
    ]
    assert found[0] == found[1]
    assert found[0] != found[2]
    assert found[0]["violation"] > 0.0


def test_what_flies_is_the_average_of_what_learns(lessons: ImitationDataset) -> None:
    school = cloner()
    before = weights(school.policy)
    assert same(before, weights(school.learner))
    school.update(drawn(lessons), in_the_mirror=False)
    assert not same(before, weights(school.learner))
    for old, new, flies in zip(
        before, weights(school.learner), weights(school.policy), strict=True
    ):
        torch.testing.assert_close(flies, old + AVERAGED * (new - old))


def test_the_rate_is_asked_for_at_each_update(lessons: ImitationDataset) -> None:
    rates = iter([1e-2, 0.0])
    torch.manual_seed(0)
    policy: Any = torch_model.build(CARD)
    school = BehaviorCloning(policy, lambda: next(rates), 8.0)
    before = weights(school.learner)
    school.update(drawn(lessons), in_the_mirror=False)
    between = weights(school.learner)
    school.update(drawn(lessons), in_the_mirror=False)
    assert not same(before, between)
    assert same(between, weights(school.learner))


def test_the_price_of_violations_is_paid(lessons: ImitationDataset) -> None:
    # flown blindly straight on, half of these flights cut into something
    after = {}
    for price in (0.0, 100.0):
        school = cloner(rate=3e-3, price=price)
        for _ in range(60):
            cost = school.update(drawn(lessons), in_the_mirror=False)
        after[price] = cost
    assert after[100.0]["violation"] < after[0.0]["violation"]
    assert after[0.0]["unlikely"] < after[100.0]["unlikely"]


def test_one_that_is_restored_goes_on_alike(lessons: ImitationDataset) -> None:
    school, again = cloner(), cloner()
    school.update(drawn(lessons), in_the_mirror=False)
    again.restore(copy.deepcopy(school.state()))  # as a file is read
    for mirror in (True, False):
        costs = [one.update(drawn(lessons), in_the_mirror=mirror) for one in (school, again)]
        assert costs[0] == costs[1]
    assert same(weights(school.policy), weights(again.policy))
    assert same(weights(school.learner), weights(again.learner))
