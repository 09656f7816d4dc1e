"""Compiled networks: actions equal those of torch, and do not depend on the batch."""

import csv
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from agents.flights.batched import fly_batch
from agents.flights.flight import fly
from agents.models import loading, shipped_agents
from agents.models.architecture import Architecture, architecture_of
from agents.models.inference.forward import CompiledNetwork
from agents.models.model_card import ModelCard
from agents.policies.lookahead import LookaheadPolicy
from agents.policies.network_policy import NetworkPolicy, network_policy
from ferguson_gym.simulation.observations import Observation
from ferguson_gym.simulation.observe import observe
from ferguson_gym.simulation.settings import settings_of
from ferguson_gym.world import transition
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field, get_fields
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from tests.support.places import ROOT

DISCS: dict[str, Any] = {"observation": "discs", "nearest": 5, "view": 20.0}
RAYS: dict[str, Any] = {"observation": "rays", "rays": 9}
BOTH: dict[str, Any] = {"observation": "both", "nearest": 4, "rays": 7, "focus": 6.0}
WAY: dict[str, Any] = {"rays": 6, "way": 5}


def card(policy: str, environment: dict[str, Any], **kwargs: Any) -> ModelCard:
    return ModelCard(
        algorithm="ppo",
        policy=policy,
        policy_kwargs={"net_arch": [40, 24], **kwargs},
        environment=environment,
    )


CARDS = [
    *(card("mlp", environment) for environment in (DISCS, RAYS, BOTH, WAY)),
    *(card("mlp", RAYS, activation_fn=name) for name in ("elu", "gelu", "relu", "silu", "tanh")),
    card("mlp", RAYS, net_arch={"pi": [], "vf": [8]}),
    card("mlp", RAYS, net_arch={"vf": [8]}),
    card("mlp-mixture", BOTH, components=1),
    card("deepsets", DISCS),
    card("deepsets", BOTH, features_extractor_kwargs={"width": 20}),
    card("deepsets", {**DISCS, "way": 2}),
    card("deepsets-mixture", BOTH, net_arch={"pi": [33], "vf": []}, activation_fn="silu"),
    ModelCard(algorithm="dagger", policy="deepsets-mixture", policy_kwargs={}, environment=DISCS),
]


def drawn(architecture: Architecture) -> CompiledNetwork:
    """A network of weights drawn at random."""
    stream = np.random.default_rng(0)
    weights = {
        name: (stream.normal(size=shape) / np.sqrt(shape[-1])).astype(np.float32)
        for name, shape in architecture.shapes.items()
    }
    return CompiledNetwork(architecture, weights)


def seen_by(environment: dict[str, Any], number: int) -> Observation:
    """Observations of vehicles at random places, some without any obstacle."""
    stream, settings = np.random.default_rng(5), settings_of(environment)
    empty = Field(name="none", obstacles=Obstacles.discs([], []))
    parts = []
    for k in range(number):
        field = (get_field("dense/train:0"), get_field("traps/train:1"), empty)[k % 3]
        vehicle = State(stream.uniform(0.0, 100.0, 2), stream.normal(size=2) * 7.0, k % 40)
        parts.append(observe(field, [vehicle], settings))
    return {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}


@pytest.mark.parametrize("given", CARDS, ids=lambda one: f"{one.policy} {one.policy_kwargs}")
def test_actions_equal_those_of_the_same_network_in_torch(given: ModelCard) -> None:
    pytest.importorskip("sb3_contrib")
    import torch

    from agents.models import torch_model
    from agents.models.torch_model import TorchModel, TorchNetwork

    torch.manual_seed(0)
    policy = torch_model.build(given)
    with torch.no_grad():
        for name, parameter in policy.named_parameters():
            if name.startswith("action_net"):
                parameter *= 20.0  # so that modes differ
    seen = seen_by(given.environment, 40)
    network = TorchModel(policy, given).model.network
    assert isinstance(network, CompiledNetwork)
    actions, theirs = network.act(seen), TorchNetwork(policy).act(seen)
    assert actions.dtype == np.float32
    assert np.ptp(theirs, axis=0).min() > 0.05
    np.testing.assert_allclose(actions, theirs, atol=2e-5)
    assert np.median(np.abs(actions - theirs)) < 1e-6
    # shapes are torch's own
    state = policy.state_dict()
    architecture = architecture_of(given)
    assert architecture is not None
    for name, shape in architecture.shapes.items():
        assert tuple(state[name].shape) == shape


@pytest.mark.parametrize(
    "name", [name for name in shipped_agents.shipped() if name != shipped_agents.BEST]
)
def test_shipped_agents_act_as_in_torch_along_their_flights(name: str) -> None:
    pytest.importorskip("sb3_contrib")
    from agents.models import torch_model
    from agents.models.torch_model import TorchNetwork

    place = shipped_agents.shipped()[name]
    model = loading.load(place)
    parts: list[Observation] = []
    for field in get_fields("standard/validation:0-59"):
        vehicle = transition.initial_state(field)
        for control in fly_batch(model, [field])[0].control:
            parts.append(observe(field, [vehicle], model.settings))
            vehicle = State(control[1], control[3], vehicle.segments + 1)
    seen = {key: np.concatenate([part[key] for part in parts])[:1000] for key in parts[0]}
    actions = model.network.act(seen)
    assert len(actions) == 1000
    theirs = TorchNetwork(torch_model.load(place).policy).act(seen)
    apart = np.abs(actions - theirs).max(axis=1)
    # between two modes of almost equal weight, the last bit decides
    assert (apart > 1e-5).sum() <= 1
    assert np.median(apart) < 1e-6


@pytest.mark.parametrize("given", CARDS, ids=lambda one: f"{one.policy} {one.policy_kwargs}")
def test_an_action_does_not_depend_on_the_other_rows(given: ModelCard) -> None:
    architecture = architecture_of(given)
    assert architecture is not None
    network, seen = drawn(architecture), seen_by(given.environment, 50)
    together = network.act(seen)
    assert together.shape == (50, 4)
    assert np.abs(together).max() <= 1.0
    order = np.random.default_rng(0).permutation(50)
    shuffled = network.act({key: value[order] for key, value in seen.items()})
    np.testing.assert_array_equal(shuffled, together[order])
    for first, size in product((0, 13, 42), (1, 2, 3, 4, 5, 7, 8)):
        part = {key: value[first : first + size] for key, value in seen.items()}
        np.testing.assert_array_equal(network.act(part), together[first : first + size])


def test_the_order_of_obstacles_and_values_in_padding_do_not_matter() -> None:
    given = card("deepsets", DISCS)
    architecture = architecture_of(given)
    assert architecture is not None
    network, seen = drawn(architecture), seen_by(DISCS, 30)
    before = network.act(seen)
    assert 0.0 < seen["mask"].mean() < 1.0
    order = np.random.default_rng(0).permutation(5)
    rows = seen["obstacles"].reshape(30, 5, 4)[:, order].reshape(30, 20)
    moved = network.act({**seen, "mask": seen["mask"][:, order], "obstacles": rows})
    np.testing.assert_allclose(moved, before, atol=1e-5)
    litter = np.where(np.repeat(seen["mask"] < 0.5, 4, axis=1), np.float32(0.7), seen["obstacles"])
    np.testing.assert_array_equal(network.act({**seen, "obstacles": litter}), before)


def test_an_overflow_gives_nan() -> None:
    architecture = architecture_of(card("deepsets-mixture", DISCS))
    assert architecture is not None
    weights = {name: np.full(shape, 1e38, "f4") for name, shape in architecture.shapes.items()}
    assert np.isnan(CompiledNetwork(architecture, weights).act(seen_by(DISCS, 3))).all()


@pytest.mark.parametrize(
    "changes",
    [
        {"algorithm": "tqc"},
        {"policy": "oracle"},
        {"policy": "oracle-mixture"},
        {"policy_kwargs": {"net_arch": [8, 0]}},
        {"policy_kwargs": {"net_arch": [8, 2.0]}},
        {"policy_kwargs": {"net_arch": {"pi": 8}}},
        {"policy_kwargs": {"net_arch": "wide"}},
        {"policy_kwargs": {"net_arch": [{"pi": [8]}]}},
        {"policy_kwargs": {"activation_fn": "wave"}},
        {"policy_kwargs": {"activation_fn": ["tanh"]}},
        {"policy_kwargs": {"share_features_extractor": False}},
        {"policy_kwargs": {"use_sde": True}},
        {"policy_kwargs": {"components": 3}},
        {"policy_kwargs": {"components": True}, "policy": "mlp-mixture"},
        {"policy_kwargs": {"features_extractor_kwargs": {"width": 8}}},
        {"policy_kwargs": {"features_extractor_kwargs": 8}, "policy": "deepsets"},
        {"policy_kwargs": {"features_extractor_kwargs": {"depth": 8}}, "policy": "deepsets"},
        {"policy": "deepsets"},
    ],
)
def test_other_networks_have_no_compiled_architecture(changes: dict[str, Any]) -> None:
    entries: dict[str, Any] = {
        "algorithm": "ppo",
        "policy": "mlp",
        "policy_kwargs": {},
        "environment": RAYS,
    }
    assert architecture_of(ModelCard(**entries)) is not None
    assert architecture_of(ModelCard(**{**entries, **changes})) is None


def test_no_flight_waits_for_a_kernel() -> None:
    """In a fresh process each kernel is compiled, or loaded, at its first call."""
    program = """
import gc
from numba.core.dispatcher import Dispatcher
from agents.flights.batched import fly_batch
from agents.flights.flight import fly
from agents.policies.registry import make_policy
from agents.runtime.kernels import compile_kernels
from ferguson_gym.world.field_names import get_field

def kernels():
    found = [thing for thing in gc.get_objects() if isinstance(thing, Dispatcher)]
    return {(k.py_func.__module__, k.py_func.__name__, *map(str, k.signatures)) for k in found}

fields = [get_field("sparse/train:0"), get_field("traps/train:0"), get_field("paper:1")]
compile_kernels()
agent = make_policy("dagger-ppo")
best = make_policy("best")
before = kernels()
for policy in (agent, best):
    fly(policy, fields[0])
fly_batch(agent.model, fields)
print(sorted(kernels() - before))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout == "[]\n"


BLOCKED = """
from importlib.machinery import PathFinder
find = PathFinder.find_spec
blocked = ("torch", "stable_baselines3", "sb3_contrib")
PathFinder.find_spec = lambda name, *more: None if name in blocked else find(name, *more)
"""


def test_the_best_agent_is_evaluated_without_torch(tmp_path: Path) -> None:
    """Worker processes included: they import the same block."""
    (tmp_path / "sitecustomize.py").write_text(BLOCKED)
    arguments = ["--policy", "best", "--policy", "dagger+shield", "--policy", "dagger-ppo"]
    where = ["--fields", "sparse/validation:0", "--out", str(tmp_path / "out")]
    path = f"{tmp_path}:{ROOT}"
    done = subprocess.run(
        [sys.executable, "-m", "agents.cli.main", "evaluate", *arguments, *where],
        env={"PYTHONPATH": path, "PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "COLUMNS": "120"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    with (tmp_path / "out" / "flights.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["success"] for row in rows] == ["1", "1", "1"]
    for row in rows:  # and the flights are those of a process with torch
        flown = fly(row["policy"], get_field(row["field"]), 0)
        assert row["length"] == repr(flown.length)


def test_shipped_agents_fly_without_torch_as_with_it() -> None:
    for name, place in shipped_agents.shipped().items():
        assert not loading.needs_torch(place), name
        assert isinstance(network_policy(place).model.network, CompiledNetwork)


def test_the_flight_flown_is_the_simulated_one() -> None:
    """They agree to the last bit, so that one simulation serves a whole flight."""
    place = shipped_agents.shipped()[shipped_agents.BEST]
    model = loading.load(place)
    for name in ("standard/validation:3", "traps/validation:1"):
        field = get_field(name)
        agent = LookaheadPolicy(NetworkPolicy(model), 6)
        agent.begin(field, 0)
        vehicle, calls, step = transition.initial_state(field), 0, None
        while step is None or step.outcome.name == "FLYING":
            calls += agent._expected is None or not np.array_equal(
                agent._expected[1], vehicle.position
            )
            action = agent.act({}, vehicle)
            assert action is not None
            step = transition.advance(field, vehicle, action)
            vehicle = step.state
        assert calls == 1
        assert not agent._ahead
