"""Behaviour cloning: gradient steps, averaged weights, mirror images, and resuming."""

import copy
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch

from agents.models import torch_model
from agents.models.model_card import ModelCard
from agents.training.imitation.behavior_cloning import AVERAGING, BehaviorCloning
from agents.training.imitation.dataset import ImitationDataset, ImitationSample, labelled_row
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
def dataset() -> ImitationDataset:
    known = ImitationDataset(settings_of(CARD.environment))
    for field in get_fields("dense/train:0-2"):
        plan = Pursuit().plan(field, initial_state(field), 0)
        rows = []
        for state, control in zip(plan.states, plan.control, strict=False):
            vehicle = state.vehicle
            action = encode(control, vehicle.position, vehicle.derivative)
            rows.append(labelled_row(int(field.name.partition(":")[2]), vehicle, action))
        known.add_states(np.array(rows), lambda seed: get_field(f"dense/train:{seed}"))
    return known


def drawn(dataset: ImitationDataset, number: int = 32) -> ImitationSample:
    return dataset.sample(np.random.default_rng(0), number, 0.0)


def make_cloning(rate: float = 1e-2, price: float = 8.0) -> BehaviorCloning:
    torch.manual_seed(0)
    policy: Any = torch_model.build(CARD)
    return BehaviorCloning(policy, lambda: rate, price)


def weights(policy: Any) -> list[torch.Tensor]:
    return [weight.detach().clone() for weight in policy.parameters()]


def same(one: list[torch.Tensor], other: list[torch.Tensor]) -> bool:
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_mirrored_update_equals_an_update_with_the_mirror_image(
    dataset: ImitationDataset,
) -> None:
    batch = drawn(dataset)
    seen, actions = mirrored(batch.observations, batch.actions)
    image = batch.obstacles.clone()
    image[:, :, 1] *= -1.0
    goal = batch.goal * torch.tensor([1.0, -1.0])
    by_hand = ImitationSample(seen, actions, goal, image, batch.present)
    found = [
        make_cloning().update(batch, mirror=True),
        make_cloning().update(by_hand, mirror=False),
        make_cloning().update(batch, mirror=False),
    ]
    assert found[0] == found[1]
    assert found[0] != found[2]
    assert found[0]["violation"] > 0.0


def test_the_policy_has_the_average_of_the_learner_s_weights(dataset: ImitationDataset) -> None:
    cloning = make_cloning()
    before = weights(cloning.policy)
    assert same(before, weights(cloning.learner))
    cloning.update(drawn(dataset), mirror=False)
    assert not same(before, weights(cloning.learner))
    for old, new, flies in zip(
        before, weights(cloning.learner), weights(cloning.policy), strict=True
    ):
        torch.testing.assert_close(flies, old + AVERAGING * (new - old))


def test_every_update_uses_the_current_learning_rate(dataset: ImitationDataset) -> None:
    rates = iter([1e-2, 0.0])
    torch.manual_seed(0)
    policy: Any = torch_model.build(CARD)
    cloning = BehaviorCloning(policy, lambda: next(rates), 8.0)
    before = weights(cloning.learner)
    cloning.update(drawn(dataset), mirror=False)
    between = weights(cloning.learner)
    cloning.update(drawn(dataset), mirror=False)
    assert not same(before, between)
    assert same(between, weights(cloning.learner))


def test_a_higher_weight_of_the_penalty_lowers_violations(dataset: ImitationDataset) -> None:
    # flown blindly straight on, half of these flights cut into something
    after = {}
    for price in (0.0, 100.0):
        cloning = make_cloning(rate=3e-3, price=price)
        for _ in range(60):
            cost = cloning.update(drawn(dataset), mirror=False)
        after[price] = cost
    assert after[100.0]["violation"] < after[0.0]["violation"]
    assert after[0.0]["unlikely"] < after[100.0]["unlikely"]


def test_a_restored_learner_continues_identically(dataset: ImitationDataset) -> None:
    cloning, again = make_cloning(), make_cloning()
    cloning.update(drawn(dataset), mirror=False)
    again.restore(copy.deepcopy(cloning.state()))  # as a file is read
    for mirror in (True, False):
        costs = [one.update(drawn(dataset), mirror=mirror) for one in (cloning, again)]
        assert costs[0] == costs[1]
    assert same(weights(cloning.policy), weights(again.policy))
    assert same(weights(cloning.learner), weights(again.learner))
