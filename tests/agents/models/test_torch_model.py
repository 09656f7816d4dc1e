"""Models in torch: actions equal the library's in any batch, and thread counts are restored."""

import dataclasses
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sb3_contrib")

import torch
from stable_baselines3 import PPO

from agents.flights.batched import fly_batch
from agents.models import loading, networks, torch_model, weights
from agents.models.inference.forward import CompiledNetwork
from agents.models.model_card import ModelCard
from agents.models.torch_model import BLOCK, TorchModel, TorchNetwork, one_thread
from agents.training.sb3_vec_env import ObstacleFieldVecEnv
from ferguson_gym.runtime.arrays import GenericArray
from ferguson_gym.world.field_names import get_fields
from tests.support.small_models import ALGORITHMS, DISCS, RAYS, card_of, learned, saved

FIELDS = "sparse/train:0-2"


def observations(policy: object, number: int) -> dict[str, GenericArray]:
    stream = np.random.default_rng(0)
    boxes = policy.observation_space.spaces  # type: ignore[attr-defined]
    return {
        key: stream.uniform(-1, 1, (number, *box.shape)).astype(np.float32)
        for key, box in boxes.items()
    }


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_actions_are_those_of_the_library(algorithm: str) -> None:
    policy = learned(algorithm, RAYS).policy
    seen = observations(policy, BLOCK)
    theirs, _ = policy.predict(seen, deterministic=True)
    np.testing.assert_array_equal(TorchNetwork(policy).act(seen), theirs)


@pytest.mark.parametrize("threads", [1, 2])
def test_an_action_does_not_depend_on_its_place_in_the_batch(threads: int) -> None:
    network = TorchNetwork(learned("ppo", {"observation": "rays"}).policy)
    seen = observations(network.policy, 3 * BLOCK + 5)
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    try:
        together = network.act(seen)
        order = np.random.default_rng(1).permutation(len(together))
        shuffled = network.act({key: value[order] for key, value in seen.items()})
        singly = [network.act({k: v[i : i + 1] for k, v in seen.items()})[0] for i in order]
        assert torch.get_num_threads() == 1
    finally:
        torch.set_num_threads(before)
    np.testing.assert_array_equal(shuffled, together[order])
    np.testing.assert_array_equal(singly, together[order])


def test_threads_are_as_before_after_a_batch_and_after_an_error() -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        fly_batch(learned("tqc", RAYS).model, get_fields(FIELDS))
        assert torch.get_num_threads() == 2
        with pytest.raises(ZeroDivisionError), one_thread():
            _ = 1 / (torch.get_num_threads() - 1)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_saved_model_is_read_back_here_and_by_the_library(algorithm: str, tmp_path: Path) -> None:
    card = dataclasses.replace(
        card_of(algorithm, DISCS), seed=3, commit="c0ffee", curve=[{"steps": 1}], results={"a": 0.5}
    )
    loaded = torch_model.load(saved(tmp_path, card) / "model.zip")
    assert loaded.card == card == loading.load(tmp_path).card
    kept = ALGORITHMS[algorithm].load(tmp_path / "model.zip", device="cpu").policy
    for one, other in zip(loaded.policy.parameters(), kept.parameters(), strict=True):
        assert torch.equal(one, other)


PLAIN_MODELS = {
    "the library's features": ({}, {}, "the shape of mlp_extractor.policy_net.0.weight is"),
    "another activation": (
        {"policy_kwargs": networks.sb3_policy_kwargs("mlp", {"activation_fn": "relu"})},
        {},
        "with the same weights it chooses other actions",
    ),
    "another observation": ({}, {"observation": "rays", "rays": 9}, "it has other observations"),
    "a name of the library": ({}, {"policy": "MultiInputPolicy"}, "unknown policy 'MultiInputP"),
}


@pytest.mark.parametrize("case", PLAIN_MODELS)
def test_a_model_that_its_card_does_not_describe_is_refused_when_it_is_saved(
    case: str, tmp_path: Path
) -> None:
    arguments, changes, message = PLAIN_MODELS[case]
    changes = dict(changes)
    policy = changes.pop("policy", "mlp")
    seen = {"observation": "discs", "nearest": 4}
    model = PPO(
        "MultiInputPolicy", ObstacleFieldVecEnv(1, fields=1, **seen), device="cpu", **arguments
    )
    card = ModelCard(algorithm="ppo", policy=policy, policy_kwargs={}, environment=changes or seen)
    before = torch.get_rng_state()
    with pytest.raises(ValueError, match=message):
        torch_model.save(tmp_path, model, card)
    assert torch.equal(torch.get_rng_state(), before)
    assert list(tmp_path.iterdir()) == []


def without_arrays(directory: Path) -> None:
    """Turn a model into one that has pickled weights only."""
    packed = directory / "model.zip"
    with zipfile.ZipFile(packed) as archive:
        kept = {name: archive.read(name) for name in archive.namelist() if "weights/" not in name}
    with zipfile.ZipFile(packed, "w") as archive:
        for name, content in kept.items():
            archive.writestr(name, content)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_model_with_pickled_weights_alone_flies_the_same(algorithm: str, tmp_path: Path) -> None:
    saved(tmp_path, card_of(algorithm, RAYS))
    assert loading.needs_torch(tmp_path) is (algorithm != "ppo")
    before = loading.load(tmp_path)
    without_arrays(tmp_path)
    assert weights.names(tmp_path / "model.zip") == []
    assert loading.needs_torch(tmp_path)
    after = loading.load(tmp_path)
    assert isinstance(after.network, CompiledNetwork) == (algorithm == "ppo")
    fields = list(get_fields(FIELDS))
    for one, other in zip(fly_batch(before, fields), fly_batch(after, fields), strict=True):
        np.testing.assert_array_equal(one.control, other.control)


@pytest.mark.parametrize("algorithm", ["ppo", "tqc"])
def test_an_exported_copy_flies_the_same_and_can_be_trained_further(
    algorithm: str, tmp_path: Path
) -> None:
    whole = saved(tmp_path / "whole", card_of(algorithm, RAYS))
    torch_model.export(whole, tmp_path / "slim")
    size, before = ((place / "model.zip").stat().st_size for place in (tmp_path / "slim", whole))
    assert size < 0.6 * before
    with zipfile.ZipFile(tmp_path / "slim" / "model.zip") as archive:
        assert all(name.endswith(".npy") for name in archive.namelist())
    flown = [
        fly_batch(loading.load(tmp_path / name), get_fields(FIELDS)) for name in ("whole", "slim")
    ]
    for mine, theirs in zip(*flown, strict=True):
        np.testing.assert_array_equal(mine.control, theirs.control)
    one, other = (torch_model.load(tmp_path / name).policy for name in ("whole", "slim"))
    for key, value in one.state_dict().items():
        assert torch.equal(value, other.state_dict()[key])
    # equal models are equal files
    torch_model.export(tmp_path / "slim", tmp_path / "again")
    read = [(tmp_path / name / "model.zip").read_bytes() for name in ("slim", "again")]
    assert read[0] == read[1]


def test_tied_weights_are_saved_once() -> None:
    shared = TorchModel(learned("ppo", RAYS).policy, card_of())
    names = list(shared.weights)
    assert not any(name.startswith(("pi_features", "vf_features")) for name in names)
    assert {"mlp_extractor.value_net.0.weight", "log_std", "action_net.bias"} <= set(names)


def test_a_model_for_flight_does_not_change_when_training_continues() -> None:
    going_on = learned("ppo", RAYS)
    model, seen = going_on.model, observations(going_on.policy, 5)
    before = model.network.act(seen)
    with torch.no_grad():
        for parameter in going_on.policy.parameters():
            parameter += 0.1
    np.testing.assert_array_equal(model.network.act(seen), before)
    assert (going_on.model.network.act(seen) != before).any()


def test_invalid_pickled_weights_are_refused(tmp_path: Path) -> None:
    saved(tmp_path)
    good = torch_model.load(tmp_path).policy.state_dict()
    for given, match in (
        ([1.0], "does not hold weights"),
        ({"a": torch.zeros(2)}, "not those of the network that model.json describes"),
        ({**good, "action_net.bias": torch.full((4,), torch.nan)}, "weights that are not finite"),
    ):
        packed = io.BytesIO()
        torch.save(given, packed)
        with zipfile.ZipFile(tmp_path / "model.zip", "w") as archive:
            archive.writestr("policy.pth", packed.getvalue())
        with pytest.raises(ValueError, match=match):
            loading.load(tmp_path)
