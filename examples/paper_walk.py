# %% [markdown]
# # A walk through the paper
# *Receding Horizon UAV Path Planning Via Gradient-Based Optimization of Ferguson Splines* (2015),
# step by step: a segment, a window of three of them, its optimisation, the receding horizon, the
# four fields. It is a script,
#
#     .venv/bin/python examples/paper_walk.py [--seeds 5] [--out results/examples]
#
# which takes seconds, prints numbers and writes four pictures, `walk-1.png` to `walk-4.png`; and it
# is a notebook: editors that know cells (`# %%`) run them one by one. docs/paper.md says where this
# project differs from the paper, and why.

# %%
"""A walk through the paper: segment, window, optimisation, receding horizon, four fields."""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from ferguson_gym.curves.arc_length import length
from ferguson_gym.curves.splines import basis, evaluate
from ferguson_gym.rendering.drawing import (
    HORIZON,
    SEEN,
    SEGMENTS,
    draw_field,
    draw_obstacles,
    draw_path,
    style,
)
from ferguson_gym.shortest_paths import exact_length, shortest_path
from ferguson_gym.world import get_field, get_fields, is_feasible
from ferguson_gym.world.paper_fields import TABLE_I
from planners.constructors import multi_start
from planners.interface import initial_state
from planners.optimization.sqp.multi_start import MultiStart

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--seeds", type=int, default=5, help="flights through each field")
parser.add_argument("--out", type=Path, default=Path("results/examples"))
told, _ = parser.parse_known_args()  # a notebook has arguments of its own
told.out.mkdir(parents=True, exist_ok=True)
plt.rcParams.update(style())
T = np.linspace(0.0, 1.0, 100)

# %% [markdown]
# ## A segment
# Section III-A. Two points and the derivatives there make a cubic,
#
#     X(t) = P0 F1(t) + P1 F2(t) + P0' F3(t) + P1' F4(t),   t in [0, 1].
#
# It is kept as a control array (4, 2): start, end, start derivative, end derivative. Segments that
# share a point and the derivative there join smoothly, which is why the paper chose them.

# %%
start, end, leave = np.array([(0.0, 0.0), (10.0, 4.0), (9.0, 0.0)])
arrive = np.array([(12.0, -9.0), (9.0, 9.0), (0.0, 15.0), (-15.0, 9.0)])

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
for weights, name in zip(basis(T).T, ("F1", "F2", "F3", "F4"), strict=True):
    left.plot(T, weights, label=name)
left.set(title="What each row of the control array weighs", xlabel="t")
left.legend(frameon=False)
for slope in arrive:
    control = np.array([start, end, leave, slope])
    (line,) = right.plot(*evaluate(control, T).T, label=f"P1' = ({slope[0]:g}, {slope[1]:g})")
    right.arrow(*end, *slope / 6.0, head_width=0.35, color=line.get_color())
    print(f"{line.get_label():17} is {length(control[None])[0]:.2f} m long")
right.arrow(*start, *leave / 6.0, head_width=0.35, color="black", zorder=3)
right.set(title="Segments that differ in P1' alone", xlabel="x [m]", ylabel="y [m]")
right.set(xlim=(-0.5, 13.5), ylim=(-2.5, 8.5), aspect="equal")
right.legend(frameon=False, loc="upper left")
figure.savefig(told.out / "walk-1.png", dpi=100)

# %% [markdown]
# ## A window
# Section III-C. Three segments are planned from where the vehicle is: twelve unknowns, P1 to P3 and
# the derivatives there. They are to end close to the goal and to get there directly,
#
#     f = d (1 + alpha l / l_min),   alpha = 0.2,
#
# with d from P3 to the goal, l the length of the three segments and l_min the straight way to P3:
# equation (2) and the text above it. Each segment is 3 to 15 m long, and clear of all obstacles
# within 45 m. Here is the third window of a flight through rng(2), of which the paper tells.

# %%
field, seed = get_field("paper:2"), 1
planner = multi_start()
flight = planner.plan(field, initial_state(field), seed)
state = flight.states[2]
window = planner.window(field, state.vehicle)
near, every = len(window.obstacles), len(field.obstacles)
print(f"{window.chain.free.sum()} unknowns, {near} of {every} obstacles")

# %% [markdown]
# ## One optimisation
# A window has many local minima. Section III-C6 starts from the last plan, moved on by a segment,
# and from ten random feasible chains, each left out if ten draws do not find one. Here each is
# searched from on its own. The last plan ends at an obstacle; a random start finds the way past it.

# %%
names, guesses = zip(*next(planner.starts(window, state, seed)), strict=True)
search = MultiStart(sidesteps=())  # without a look into neighbouring gaps, which the paper has not
ends = [search.solve(window, [guess])[0] for guess in guesses]
values = [found.solution.objective if found.feasible else np.inf for found in ends]
for name, found, value in zip(names, ends, values, strict=True):
    last = found.control[-1, 1]
    d, direct = np.linalg.norm(field.goal - last), np.linalg.norm(last - state.vehicle.position)
    along = length(found.control).sum()
    print(f"{name:10} d = {d:5.2f} m, l / l_min = {along / direct:.3f}, f = {value:5.2f} m")

figure, panels = plt.subplots(1, 2, figsize=(9, 4.3), layout="constrained", sharey=True)
for axes, chains in zip(panels, (guesses, [found.control for found in ends]), strict=True):
    draw_field(axes, field)
    draw_obstacles(axes, window.obstacles, SEEN)
    axes.plot(*np.concatenate(evaluate(flight.control[:2], T)).T, "k", lw=2.0)
    for chain, name, value in zip(chains, names, values, strict=True):
        line = "-" if np.isfinite(value) else ":"  # dotted: not certified, so never flown
        wide = 3.0 if value == min(values) else 1.2
        axes.plot(*np.concatenate(evaluate(chain, T)).T, line, lw=wide, label=name, zorder=5)
    x, y = state.vehicle.position
    axes.set(xlim=(x - 15, x + 35), ylim=(y - 15, y + 35))
panels[0].set_title("starts of a window")
panels[1].set_title("where they lead; bold: the least f")
figure.legend(*panels[1].get_legend_handles_labels(), loc="outside right center", frameon=False)
figure.savefig(told.out / "walk-2.png", dpi=100)

# %% [markdown]
# ## The receding horizon
# The first of the three segments is flown, and three are planned again (purple; darker, obstacles
# that are looked at), until P3 comes to the goal. Then the last ones are optimised once more, for
# length alone. The paper wants 29 points of a segment clear; here the whole curve is certified.

# %%
figure, panels = plt.subplots(
    2, 3, figsize=(9, 6.2), layout="constrained", sharex=True, sharey=True
)
for axes, step in zip(panels.flat, (0, 2, 3, 4, 5, 7), strict=True):
    draw_field(axes, field)
    draw_obstacles(axes, field.obstacles.near(flight.states[step].vehicle.position, 45.0), SEEN)
    draw_path(axes, flight.control[:step])
    chain = flight.decisions[step].chain
    axes.plot(*np.concatenate(evaluate(chain, T)).T, lw=1.8, color=HORIZON)
    axes.plot(*chain[:, 1].T, ".", color=HORIZON, ms=6)
    axes.set_title(f"after {step} segments")
figure.savefig(told.out / "walk-3.png", dpi=100)
certified = is_feasible(flight.control, field)
print(f"{field.name}: {flight.status.sentence}, {flight.path.length:.2f} m, {flight.evaluations}")
print(f"evaluations of f, {certified.sum()} of {len(certified)} segments certified feasible")

# %% [markdown]
# ## The four fields, and Table I
# The paper prints one run for each of its fields, which are rebuilt here from its seeds: likely its
# own, not certainly. Random starts make ours a spread of runs (blue). Dotted is the shortest path,
# which is found exactly. docs/paper.md has thirty runs of each, and why they are shorter.

# %%
figure, panels = plt.subplots(
    2, 2, figsize=(9, 9.2), layout="constrained", sharex=True, sharey=True
)
print("          paper, segments   ours, median     least      most  segments   shortest path")
for axes, field in zip(panels.flat, get_fields("paper:1-4"), strict=True):
    plans = [planner.plan(field, initial_state(field), number) for number in range(told.seeds)]
    paths = [plan.path for plan in plans if plan.path is not None]
    lengths, segments = [path.length for path in paths], [len(path) for path in paths]
    paper, middle = TABLE_I["multi-start", field.name], np.median(lengths)
    print(
        f"{field.name:9}{paper.length:7.2f} m {paper.segments:7}{middle:12.2f} m"
        f"{min(lengths):8.2f} m{max(lengths):8.2f} m{np.median(segments):10g}"
        f"{exact_length(field):14.2f} m"
    )
    draw_field(axes, field)
    for path in paths:
        axes.plot(*path.points().T, color=SEGMENTS[0], lw=1.8, alpha=0.6)
    axes.plot(*shortest_path(field).points(0.5).T, "k:", lw=1.2)
    axes.set_title(f"{field.name}: {middle:.2f} m in the median, the paper's {paper.length:.2f} m")
figure.savefig(told.out / "walk-4.png", dpi=100)
