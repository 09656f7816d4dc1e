"""Feature extractors: obstacles are a set, and features are finite for any observation."""

from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("stable_baselines3")

import torch
from gymnasium import spaces

from agents.models.extractors import DeepSets, Plain
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.spaces import observation_space
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State

DISCS: dict[str, Any] = {"observation": "discs", "nearest": 6}
RAYS: dict[str, Any] = {"observation": "rays", "rays": 9}
BOTH: dict[str, Any] = {"observation": "both", "nearest": 4, "rays": 7}
WAY: dict[str, Any] = {**BOTH, "way": 3}
NEAR = 10.0
"""A view [m] that fills some rows of some observations."""


def space_of(arguments: dict[str, Any]) -> spaces.Dict:
    space = observation_space(Settings(**arguments))
    assert isinstance(space, spaces.Dict)
    return space


def seen_in(field: Field, arguments: dict[str, Any], number: int = 20) -> dict[str, Any]:
    stream = np.random.default_rng(5)
    vehicles = [
        State(stream.uniform(0.0, 100.0, 2), stream.normal(size=2) * 7.0, k % 40)
        for k in range(number)
    ]
    seen = observe(field, vehicles, Settings(**arguments))
    return {key: torch.from_numpy(value.copy()) for key, value in seen.items()}


def made(kind: Any, arguments: dict[str, Any]) -> Any:
    torch.manual_seed(0)
    return kind(space_of(arguments))


@pytest.mark.parametrize(
    ("kind", "arguments"),
    [
        *((Plain, arguments) for arguments in (DISCS, RAYS, BOTH, WAY)),
        *((DeepSets, arguments) for arguments in (DISCS, BOTH, WAY)),
    ],
)
@pytest.mark.parametrize("spec", ["dense/train:0", "traps/train:1", "none"])
def test_features_and_gradients_are_finite_and_features_have_the_documented_size(
    kind: Any, arguments: dict[str, Any], spec: str
) -> None:
    field = (
        Field(name="none", obstacles=Obstacles.discs([], [])) if spec == "none" else get_field(spec)
    )
    net, seen = made(kind, arguments), seen_in(field, arguments)
    free = {key: value.requires_grad_() for key, value in seen.items()}
    features = net(free)
    assert features.shape == (20, net.features_dim)
    assert torch.isfinite(features).all()
    if spec == "none" and "mask" in seen:
        assert not seen["mask"].any()
    # every feature contributes, with either sign
    (features * torch.sin(torch.arange(net.features_dim))).sum().backward()
    for weight in net.parameters():
        assert weight.grad is not None
        assert torch.isfinite(weight.grad).all()
    for key, value in free.items():
        assert value.grad is None or torch.isfinite(value.grad).all(), key


def shuffled(seen: dict[str, Any]) -> dict[str, Any]:
    order = torch.randperm(seen["mask"].shape[1])
    rows = seen["obstacles"].view(len(seen["mask"]), -1, 4)
    return {**seen, "mask": seen["mask"][:, order], "obstacles": rows[:, order].flatten(1)}


@pytest.mark.parametrize("arguments", [DISCS, BOTH])
def test_the_order_of_obstacles_does_not_matter(arguments: dict[str, Any]) -> None:
    arguments = {**arguments, "view": NEAR}
    net, seen = made(DeepSets, arguments), seen_in(get_field("standard/train:0"), arguments)
    assert 0.0 < float(seen["mask"].mean()) < 1.0
    with torch.no_grad():
        torch.testing.assert_close(net(shuffled(seen)), net(seen), atol=1e-5, rtol=1e-5)


def test_values_in_padding_rows_do_not_matter() -> None:
    near = {**BOTH, "view": NEAR}
    net, seen = made(DeepSets, near), seen_in(get_field("standard/train:0"), near)
    padding = (seen["mask"] < 0.5).repeat_interleave(4, dim=1)
    assert padding.any()
    litter = torch.where(padding, torch.rand_like(seen["obstacles"]), seen["obstacles"])
    with torch.no_grad():
        found = net({**seen, "obstacles": litter})
        torch.testing.assert_close(found, net(seen), atol=1e-5, rtol=1e-5)


def test_the_number_of_padding_rows_does_not_matter() -> None:
    net, wider = made(DeepSets, DISCS), made(DeepSets, {**DISCS, "nearest": 11})
    wider.load_state_dict(net.state_dict())
    seen = seen_in(get_field("dense/train:0"), DISCS)
    assert (seen["mask"].sum(dim=1) == 6.0).any()  # some observations have no padding
    more = {
        **seen,
        "mask": torch.cat([seen["mask"], torch.zeros(20, 5)], dim=1),
        "obstacles": torch.cat([seen["obstacles"], torch.zeros(20, 20)], dim=1),
    }
    with torch.no_grad():
        torch.testing.assert_close(wider(more), net(seen), atol=1e-5, rtol=1e-5)


def test_each_obstacle_matters() -> None:
    net, seen = made(DeepSets, DISCS), seen_in(get_field("dense/train:0"), DISCS)
    with torch.no_grad():
        before = net(seen)
        for k in range(6):
            without = {**seen, "mask": seen["mask"].clone()}
            without["mask"][:, k] = 0.0
            moved = (net(without) - before).abs().amax(dim=1)
            assert (moved[seen["mask"][:, k] > 0.5] > 1e-6).all()
            assert (moved[seen["mask"][:, k] < 0.5] == 0.0).all()


def test_a_policy_over_obstacles_refuses_rays_alone() -> None:
    with pytest.raises(
        ValueError, match=r"this policy needs obstacles in the observation: .*, not rays"
    ):
        made(DeepSets, RAYS)


def test_points_of_the_way_are_shown_in_multiples_of_their_distance() -> None:
    net, seen = (
        made(Plain, {**RAYS, "way": 4}),
        seen_in(get_field("sparse/train:0"), RAYS, number=2),
    )
    ahead = [0.25, 0.0, 0.4, 0.3, 0.0, 0.75, -0.8, 0.6]  # at 1/4, 2/4, 3/4 and 4/4 of the view
    seen["way"] = torch.tensor([[*ahead, 0.2, 0.05], [*ahead, 1.0, 0.5]])
    features = net(seen)
    expected = [1.0, 0.0, 0.8, 0.6, 0.0, 1.0, -0.8, 0.6]
    np.testing.assert_allclose(features[0, -11:], [*expected, 0.2, 0.05, 0.6], rtol=1e-6)
    np.testing.assert_allclose(features[1, -11:], [*expected, 1.0, 0.5, 1.0], rtol=1e-6)


def test_the_goal_is_shown_on_finer_scales_too() -> None:
    net, seen = made(Plain, RAYS), seen_in(get_field("sparse/train:0"), RAYS, number=2)
    seen["goal"] = torch.tensor([[0.02, 0.6, 0.8], [0.5, 1.0, 0.0]])
    features = net(seen)
    np.testing.assert_allclose(features[0, 9:15], [0.1, 0.06, 0.08, 0.28, 0.168, 0.224], rtol=1e-5)
    np.testing.assert_allclose(features[1, 9:15], [1.0, 1.0, 0.0, 1.0, 1.0, 0.0], rtol=1e-5)
