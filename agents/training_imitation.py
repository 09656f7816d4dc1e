"""Imitation: behaviour cloning of demonstrations, and DAgger, which asks an expert on the way.

A round of DAgger is a number of updates; meanwhile the policy as it was at its beginning flies
through new fields, and the expert says what it would have done. So it does not matter how many
processes fly, nor which is faster.

Reference:
    Ross, Gordon & Bagnell (2011), A reduction of imitation learning and structured prediction to
    no-regret online learning, AISTATS.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joblib import Parallel, delayed
from stable_baselines3 import PPO

from agents import models, networks, training, training_demos
from agents.arguments import DONE, Job
from agents.cloning import Cloner
from agents.lessons import COLUMNS, Lessons, row
from agents.models import Card
from agents.training import Run
from agents.training_pace import Pace, stop_on_interrupt
from agents.training_recipe import slope
from agents.training_record import Record, card_of
from agents.training_sb3 import progress_bar, starting_model
from agents.vec_env import ObstacleFieldVecEnv
from agents.visits import Visit, Visited, visit
from ferguson_gym.arrays import Array
from ferguson_gym.catalog import select
from ferguson_gym.files import written_whole
from ferguson_gym.interface import settings_of
from planners.catalog import make
from planners.interface import Replanner

SETTINGS: dict[str, Any] = {
    "expert": "pursuit",
    "scattered": 0.3,
    "first": 10,
    "updates": 400,
    "batch_size": 1024,
    "learning_rate": 1e-3,
    "violation": 8.0,
}
"""Keys of a recipe beside those that all have, and their values where it is silent: who is asked,
the share of flights that begin anywhere, how many rounds' flights are watched before the first
update, updates of a round, lessons of an update, and the price of a metre of violation. A round
flies `n_envs` flights; `n_timesteps` and `eval_freq` count states that the expert was asked about
(`dagger`) or lessons that were learned from (`bc`)."""
KEYS = frozenset(SETTINGS)
_SHARES = 8
"""That a round's flights are handed out in."""
_FIELDS = 10_000_000
"""Fields between those of one seed and the next."""
_STATE = "state.pt"
