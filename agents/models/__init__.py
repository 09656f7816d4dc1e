"""Learned models: stored as weights and a model card, and evaluated by networks.

`load` reads a model directory and returns a `Model`: a network that maps observations to actions,
and the `ModelCard` that describes it. Loading and flying a shipped agent needs no torch: its
network runs as compiled kernels (`inference`). `torch_model` builds, trains and saves networks;
`shipped_agents` finds the agents that come with the package by name.
"""

from agents.models.loading import load as load
from agents.models.model import Model as Model
from agents.models.model_card import ModelCard as ModelCard
