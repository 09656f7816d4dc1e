"""Behaviour cloning: maximum likelihood of an expert's actions, with a penalty on infeasible ones.

Reference:
    Pomerleau (1991), Efficient training of artificial neural networks for autonomous navigation,
    Neural Computation 3(1).
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.training.imitation.dataset import ImitationSample
from agents.training.imitation.mirror import mirrored, mirrored_cores
from agents.training.imitation.violation_penalty import speed_of, violation

AVERAGING = 0.005
"""Share by which each update moves the averaged weights towards the learner's."""
_MAX_GRADIENT_NORM = 1.0
_MAX_VIOLATION = 5.0
"""Violation [m] without gradient above: an untrained policy would learn nothing else."""


class BehaviorCloning:
    """Optimiser of a learner, and the exponential average of its weights, which is evaluated.

    Args:
        policy: gets the averaged weights; the learner starts as a copy of it.
        rate: returns the learning rate of the next update.
        price: weight of the violation penalty, in units of log-likelihood per metre.
    """

    def __init__(self, policy: ActorCriticPolicy, rate: Callable[[], float], price: float) -> None:
        self.policy, self.learner = policy, copy.deepcopy(policy)
        self._rate, self._price = rate, price
        self._optimizer = torch.optim.Adam(self.learner.parameters(), lr=0.0)
        self.learner.set_training_mode(True)

    def update(self, batch: ImitationSample, mirror: bool) -> dict[str, float]:
        """Take a gradient step, from the samples of a batch or from their mirror images.

        Returns:
            Mean negative log-likelihood (`unlikely`) and mean violation [m] before the step.
        """
        observations, actions, obstacles = batch.observations, batch.actions, batch.obstacles
        goal = batch.goal
        if mirror:
            observations, actions = mirrored(observations, actions)
            obstacles = mirrored_cores(obstacles)
            goal = goal * goal.new_tensor([1.0, -1.0])
        for group in self._optimizer.param_groups:
            group["lr"] = self._rate()
        distribution = self.learner.get_distribution(observations)
        likelihood_loss = -distribution.log_prob(actions).mean()
        violations = violation(
            distribution.mode().clamp(-1.0, 1.0),
            speed_of(observations["vehicle"][:, 4]),
            goal,
            obstacles,
            batch.present,
        )
        loss = likelihood_loss + self._price * violations.clamp(max=_MAX_VIOLATION).mean()
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.learner.parameters(), _MAX_GRADIENT_NORM)
        self._optimizer.step()
        with torch.no_grad():
            for average, current in zip(
                self.policy.parameters(), self.learner.parameters(), strict=True
            ):
                average.lerp_(current, AVERAGING)
        return {
            "unlikely": float(likelihood_loss.detach()),
            "violation": float(violations.detach().mean()),
        }

    def state(self) -> dict[str, Any]:
        """All that is needed to resume, tensors and numbers."""
        return {
            "policy": self.policy.state_dict(),
            "learner": self.learner.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Resume from a `state`."""
        self.policy.load_state_dict(state["policy"])
        self.learner.load_state_dict(state["learner"])
        self._optimizer.load_state_dict(state["optimizer"])
