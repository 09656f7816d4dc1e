"""A picture of `learnability.py train`: its learning curve, and its best policy's flights.

Run it from a checkout, after the training:

    .venv/bin/python benchmarks/learnability_picture.py results/ppo docs/images/learnability.png
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from learnability_variants import CHOSEN, PHASES
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from stable_baselines3 import PPO

from ferguson_gym.environment import ObstacleField
from ferguson_gym.rendering.drawing import START, draw_field, draw_path, draw_refused, style
from ferguson_gym.shortest_paths.exact import shortest_path
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.outcome import Outcome

FIELDS = ("standard/validation:200", "standard/validation:201", "standard/validation:202")
AROUND = 0.74
"""SPL of flying around every field."""


def main(results: Path, picture: Path) -> None:
    """Draw the picture."""
    curve = json.loads((results / "curve.json").read_text())
    model = PPO.load(results / "best.zip", device="cpu")
    with mpl.rc_context(style()):
        figure = Figure(figsize=(12.0, 3.6), layout="constrained")
        FigureCanvasAgg(figure)
        axes, *panels = figure.subplots(1, 1 + len(FIELDS), width_ratios=[1.15, 1, 1, 1])
        millions = [point["steps"] / 1e6 for point in curve]
        for key, label in (("spl", "SPL"), ("success", "success")):
            axes.plot(millions, [point[key] for point in curve], label=label)
        axes.axhline(AROUND, ls=":", color="#555555", lw=1)
        axes.text(millions[-1], AROUND - 0.04, "SPL of flying around", fontsize=7, ha="right")
        axes.set(xlabel="million steps", xlim=0, ylim=(0, 1), title="standard/validation:0-199")
        axes.legend(loc="lower right", frameon=False)
        for panel, name in zip(panels, FIELDS, strict=True):
            env = ObstacleField(**CHOSEN)
            seen, info = env.reset(seed=0, options={"field": name})
            over = False
            while not over:
                flat = np.concatenate(list(seen.values()))
                choice, _ = model.predict(flat, deterministic=True)
                (action,) = PHASES[-1].variant.act(choice[None]).astype(np.float32)
                seen, _, terminated, truncated, info = env.step(action)
                over = terminated or truncated
            field = get_field(name)
            draw_field(panel, field)
            exact = shortest_path(field)
            if exact is not None:
                points = exact.points(0.5)
                panel.plot(points[:, 0], points[:, 1], "--", color=START, lw=1, zorder=3)
            draw_path(panel, env.control)
            if env.refused is not None:
                draw_refused(panel, env.refused)
            sentence = Outcome.from_code(info["outcome"]).sentence
            panel.set_title(f"{name}\n{info['path_length']:.1f} m, {sentence}")
        figure.savefig(picture)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
