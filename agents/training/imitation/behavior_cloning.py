"""Behaviour cloning: a policy becomes likely to do what an expert did, and unlikely to fail.

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
from agents.training.imitation.mirror import mirrored
from agents.training.imitation.violation_penalty import speed_of, violation

AVERAGED = 0.005
"""Share of the learner's weights that each update moves into those that fly."""
_STEEPEST = 1.0
"""Greatest norm of a gradient."""
_DEAREST = 5.0
"""Greatest violation [m] that has a slope: a policy that has learned nothing is no reason to
learn nothing else."""


class BehaviorCloning:
    """A learner, and the average of its weights over its last updates, which is what flies.

    Args:
        policy: flies; its weights are the average.
        rate: learning rate, as a function without arguments.
        price: of a metre of violation, in units of log-likelihood.
    """

    def __init__(self, policy: ActorCriticPolicy, rate: Callable[[], float], price: float) -> None:
        self.policy, self.learner = policy, copy.deepcopy(policy)
        self._rate, self._price = rate, price
        self._optimizer = torch.optim.Adam(self.learner.parameters(), lr=0.0)
        self.learner.set_training_mode(True)

    def update(self, lesson: ImitationSample, in_the_mirror: bool) -> dict[str, float]:
        """Learn from some lessons, as they are or in the mirror; what they cost."""
        seen, actions, discs = lesson.seen, lesson.actions, lesson.discs
        if in_the_mirror:
            seen, actions = mirrored(seen, actions)
            discs = discs * discs.new_tensor([1.0, -1.0, 1.0])
        for group in self._optimizer.param_groups:
            group["lr"] = self._rate()
        distribution = self.learner.get_distribution(seen)
        unlikely = -distribution.log_prob(actions).mean()
        lacking = violation(
            distribution.mode().clamp(-1.0, 1.0),
            speed_of(seen["vehicle"][:, 4]),
            discs,
            lesson.present,
        )
        loss = unlikely + self._price * lacking.clamp(max=_DEAREST).mean()
        self._optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.learner.parameters(), _STEEPEST)
        self._optimizer.step()
        with torch.no_grad():
            for flying, learning in zip(
                self.policy.parameters(), self.learner.parameters(), strict=True
            ):
                flying.lerp_(learning, AVERAGED)
        return {"unlikely": float(unlikely.detach()), "violation": float(lacking.detach().mean())}

    def state(self) -> dict[str, Any]:
        """All that is needed to go on, tensors and numbers."""
        return {
            "policy": self.policy.state_dict(),
            "learner": self.learner.state_dict(),
            "optimizer": self._optimizer.state_dict(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a `state`."""
        self.policy.load_state_dict(state["policy"])
        self.learner.load_state_dict(state["learner"])
        self._optimizer.load_state_dict(state["optimizer"])
