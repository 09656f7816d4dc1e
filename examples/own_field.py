"""A custom field: buildings from a CSV file, covered by discs, and a flight between them.

Run it from a checkout; it takes seconds:

    .venv/bin/python examples/own_field.py
    .venv/bin/python examples/own_field.py --buildings my.csv --cell 2

Each line of the file is a rectangle: `x` and `y` of its corner in the south-west, `width` to the
east and `depth` to the north, in metres. Start is (0, 0), goal (100, 100), bounds are -10 to 110 m.

Fields are made of discs, so each rectangle is cut into cells, and a disc is drawn around each cell
on its border. Such a cover is safe: it contains all walls, without gaps between its discs. It costs
free space, since discs bulge over the walls: by 0.21 s in the middle of a square cell of side s.
The table shows the trade-off: coarse cells close the alley in the middle of town, so the flight
goes around; cells of a third of the side need three times as many discs.

It writes `town.json`, a field that the command line takes by its path, and the picture `town.png`.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from agents.flights import Flight, fly
from ferguson_gym.rendering.drawing import draw_field, draw_path
from ferguson_gym.world import Obstacles, is_feasible
from ferguson_gym.world.field import Field, to_json

SIDES = ("x", "y", "width", "depth")


def read(file: Path) -> np.ndarray:
    """Rectangles (n, 4) of a CSV file: x, y, width, depth [m]."""
    with file.open(newline="", encoding="utf-8") as lines:
        table = csv.DictReader(lines, restval="")
        if not set(SIDES) <= set(table.fieldnames or ()):
            raise ValueError(f"{file}: need columns {', '.join(SIDES)}, got {table.fieldnames}")
        walls = np.array([[float(row[key]) for key in SIDES] for row in table]).reshape(-1, 4)
    if not len(walls) or not (walls[:, 2:] > 0.0).all():
        raise ValueError(f"{file}: need buildings, all of them with a width and depth above 0 m")
    return walls


def cover(buildings: np.ndarray, cell: float) -> Obstacles:
    """Discs around the cells, at most `cell` [m] wide, on the borders of rectangles (n, 4)."""
    if not cell > 0.0:
        raise ValueError(f"cells have a side above 0 m, got {cell} m")
    centers, radii = [], []
    for x, y, *size in buildings:
        columns, rows = np.ceil(np.array(size) / cell).astype(int)
        wide, deep = size[0] / columns, size[1] / rows
        for i, j in np.ndindex(columns, rows):
            if i in (0, columns - 1) or j in (0, rows - 1):
                centers.append((x + (i + 0.5) * wide, y + (j + 0.5) * deep))
                radii.append(np.hypot(wide, deep) / 2.0)
    return Obstacles.discs(np.array(centers), np.array(radii))


def from_walls(points: np.ndarray, buildings: np.ndarray) -> np.ndarray:
    """Distance of points (m, 2) to the nearest rectangle [m], negative inside."""
    low, size = buildings[:, :2], buildings[:, 2:]
    beyond = np.abs(points[:, None] - low - size / 2.0) - size / 2.0
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=-1)
    return (outside + np.minimum(beyond.max(axis=-1), 0.0)).min(axis=1)


def draw(flight: Flight, buildings: np.ndarray, file: Path) -> None:
    """A picture of the flight over the discs, and over the walls that they cover."""
    figure = Figure(figsize=(6, 6), layout="constrained")
    axes = figure.subplots()
    draw_field(axes, flight.field)
    for x, y, width, depth in buildings:
        axes.add_patch(Rectangle((x, y), width, depth, color="#5d6d7e", zorder=3))
    draw_path(axes, flight.control)
    axes.set_title(f"{flight.field.name}: {flight.length:.1f} m, {flight.outcome.sentence}")
    figure.savefig(file, dpi=100)


def main(walls: np.ndarray, cell: float, out: Path) -> None:
    """Cover the town coarsely, as asked, and finely; what is asked for is certified and saved."""
    flights: list[Flight] = []
    print("   cell   discs   bulge   shortest path   flown by guided")
    for side in (3.0 * cell, cell, cell / 3.0):
        discs = cover(walls, side)
        field = Field(name=f"town in cells of {side:.3g} m", obstacles=discs)
        flight = fly("guided", field)
        flights.append(flight)
        bulge = (discs.radii + from_walls(discs.centers, walls)).max()
        exact = flight.exact_length or np.inf  # none where the discs leave no way
        print(
            f"{side:5.3g} m{len(discs):8}{bulge:6.2f} m{exact:14.2f} m"
            f"{flight.length:16.2f} m, {flight.outcome.sentence}"
        )
    flight = flights[1]
    feasible = is_feasible(flight.control, flight.field)  # along whole segments, not at samples
    print(f"cells of {cell:g} m: {feasible.sum()} of {len(feasible)} segments certified feasible")
    out.mkdir(parents=True, exist_ok=True)
    to_json(flight.field, out / "town.json")
    draw(flight, walls, out / "town.png")
    print(f"plan it again:\n    .venv/bin/ferguson plan {out / 'town.json'} --planner guided")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    here = Path(__file__).parent
    parser.add_argument("--buildings", type=Path, default=here / "buildings.csv")
    parser.add_argument("--cell", type=float, default=4.0, help="greatest side of a cell [m]")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    told = parser.parse_args()
    try:
        walls = read(told.buildings)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    main(walls, told.cell, told.out)
