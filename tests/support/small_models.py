"""Models that are small and know nothing, saved as trained ones are."""

from pathlib import Path
from typing import Any

import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.models import networks, torch_model
from agents.models.model_card import ModelCard
from agents.models.torch_model import TorchModel
from agents.training.sb3_vec_env import ObstacleFieldVecEnv

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "tqc": TQC}
RAYS: dict[str, Any] = {"observation": "rays", "rays": 9}
DISCS: dict[str, Any] = {"observation": "discs", "nearest": 4, "focus": 6.0}


def card_of(algorithm: str = "ppo", environment: dict[str, Any] | None = None) -> ModelCard:
    return ModelCard(
        algorithm=algorithm,
        policy="mlp",
        policy_kwargs={"net_arch": [24, 24], "activation_fn": "tanh"},
        environment=environment or RAYS,
    )


def learned(algorithm: str, environment: dict[str, Any]) -> TorchModel:
    """A policy that flies some way before it ends."""
    torch.manual_seed(1)
    card = card_of(algorithm, environment)
    policy = torch_model.build(card)
    with torch.no_grad():
        for name, parameter in policy.named_parameters():
            if name in ("action_net.weight", "actor.mu.weight"):
                parameter *= 0.3
    return TorchModel(policy, card)


def saved(directory: Path, card: ModelCard | None = None, seed: int = 0) -> Path:
    """The directory, with a model in it."""
    card = card or card_of()
    envs = ObstacleFieldVecEnv(1, fields=1, **card.environment)
    few: dict[str, Any] = {"n_steps": 2, "batch_size": 2} if card.algorithm == "ppo" else {}
    model = ALGORITHMS[card.algorithm](
        networks.policy_class(card.algorithm, card.policy),
        envs,
        seed=seed,
        device="cpu",
        policy_kwargs=networks.sb3_policy_kwargs(card.policy, card.policy_kwargs),
        **few or {"buffer_size": 10},
    )
    directory.mkdir(parents=True, exist_ok=True)
    torch_model.save(directory, model, card)
    return directory


def weights_of(directory: Path) -> list[torch.Tensor]:
    """Of the policy that is saved there."""
    return list(torch_model.load(directory).policy.state_dict().values())


def same(one: list[torch.Tensor], other: list[torch.Tensor]) -> bool:
    """Whether weights agree to the last bit."""
    return all(torch.equal(a, b) for a, b in zip(one, other, strict=True))
