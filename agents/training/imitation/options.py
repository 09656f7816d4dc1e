"""Hyperparameters of behaviour cloning and DAgger, checked; needs no PyTorch."""

from __future__ import annotations

from dataclasses import dataclass

from agents.training.hyperparameters import slope

WAY_EXPERT = "way"
"""Name of the expert that flies along the way which observations show."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ImitationOptions:
    """Keys of `bc` and `dagger` in a file of hyperparameters, with their default values.

    A round flies `n_envs` rollouts. `n_timesteps` and `eval_freq` count states that were
    visited (`dagger`) or samples in all updates (`bc`).

    Raises:
        ValueError: a value of another type or out of its range.
    """

    expert: str = "pursuit"
    """Planner that labels states with actions; it must decide step by step. Or `way`: segments of
    7 m along the way that observations show, for many states at once."""
    scattered: float = 0.3
    """Share of rollouts that start at a random state instead of the start of their field."""
    first: int = 10
    """Rollouts before the first update, in multiples of those of a round."""
    updates: int = 400
    """Gradient steps in a round."""
    batch_size: int = 512
    """Samples in a gradient step."""
    hard: float = 0.25
    """Share of a batch that is drawn near refused segments."""
    learning_rate: float | str = 1e-3
    """Of Adam; `lin_X` decreases it linearly from X over the training."""
    violation: float = 8.0
    """Weight of the violation penalty, in units of log-likelihood per metre."""

    def __post_init__(self) -> None:
        for key in ("updates", "batch_size", "first"):
            number = getattr(self, key)
            if type(number) is not int or number < 1:
                raise ValueError(f"{key} must be an integer >= 1, got {number!r}")
        for key, most in (("scattered", 1.0), ("hard", 1.0), ("violation", 1e6)):
            value = getattr(self, key)
            if type(value) not in (int, float) or not 0.0 <= value <= most:
                raise ValueError(f"{key} must lie between 0 and {most:g}, got {value!r}")
        top = slope(self.learning_rate)
        rate = self.learning_rate if top is None else top
        if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0.0 < rate < 1.0:
            raise ValueError(f"learning_rate must lie between 0 and 1, got {self.learning_rate!r}")
