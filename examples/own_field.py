"""A custom field: buildings from a CSV file, and flights between them for vehicles of three sizes.

Run it from a checkout; it takes seconds:

    .venv/bin/python examples/own_field.py
    .venv/bin/python examples/own_field.py --buildings my.csv --radius 0.3

Each line of the file is a rectangle: `x` and `y` of its corner in the south-west, `width` to the
east and `depth` to the north, in metres. Start is (0, 0), goal (100, 100), bounds are -10 to 110 m.

Rectangles are obstacles as they are. A vehicle of a radius is planned for as a point among
obstacles that are grown by this radius, which rounds their corners. The table shows what size
costs: a wide vehicle does not fit into the alley in the middle of town, so it flies around.

It writes `town.json`, a field that the command line takes by its path, and the picture `town.png`.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from agents.flights import Flight, fly
from ferguson_gym.rendering.drawing import SEEN, draw_field, draw_obstacles, draw_path
from ferguson_gym.world import Obstacles, is_feasible
from ferguson_gym.world.field import Field, to_json

SIDES = ("x", "y", "width", "depth")


def read(file: Path) -> Obstacles:
    """The buildings of a CSV file: rectangles in columns x, y, width, depth [m]."""
    with file.open(newline="", encoding="utf-8") as lines:
        table = csv.DictReader(lines, restval="")
        if not set(SIDES) <= set(table.fieldnames or ()):
            raise ValueError(f"{file}: need columns {', '.join(SIDES)}, got {table.fieldnames}")
        walls = np.array([[float(row[key]) for key in SIDES] for row in table]).reshape(-1, 4)
    if not len(walls) or not (walls[:, 2:] > 0.0).all():
        raise ValueError(f"{file}: need buildings, all of them with a width and depth above 0 m")
    corners, sizes = walls[:, :2], walls[:, 2:]
    return Obstacles.boxes(corners, corners + sizes)


def draw(flight: Flight, buildings: Obstacles, file: Path) -> None:
    """A picture of the flight, the buildings, and the room around them that the vehicle needs."""
    figure = Figure(figsize=(6, 6), layout="constrained")
    axes = figure.subplots()
    draw_field(axes, flight.field)
    draw_obstacles(axes, buildings, SEEN)
    draw_path(axes, flight.control)
    axes.set_title(f"{flight.field.name}: {flight.length:.1f} m, {flight.outcome.sentence}")
    figure.savefig(file, dpi=100)


def main(town: Field, radius: float, out: Path) -> None:
    """Fly a point, the vehicle asked for, and a wide one; the second flight is saved."""
    flights: list[Flight] = []
    print("radius   shortest path   flown by guided")
    for size in (0.0, radius, 3.0 * radius):
        flight = fly("guided", town.inflated(size))
        flights.append(flight)
        exact = flight.exact_length or np.inf  # none where the vehicle does not fit through
        print(f"{size:4.2g} m{exact:14.2f} m{flight.length:16.2f} m, {flight.outcome.sentence}")
    flight = flights[1]
    feasible = is_feasible(flight.control, flight.field)  # along whole segments, not at samples
    print(f"radius {radius:g} m: {feasible.sum()} of {len(feasible)} segments certified feasible")
    out.mkdir(parents=True, exist_ok=True)
    to_json(flight.field, out / "town.json")
    draw(flight, town.obstacles, out / "town.png")
    print(f"plan it again:\n    .venv/bin/ferguson plan {out / 'town.json'} --planner guided")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    here = Path(__file__).parent
    parser.add_argument("--buildings", type=Path, default=here / "buildings.csv")
    parser.add_argument("--radius", type=float, default=0.8, help="radius of the vehicle [m]")
    parser.add_argument("--out", type=Path, default=Path("results/examples"))
    told = parser.parse_args()
    try:
        town = Field(name="town", obstacles=read(told.buildings))
        town.inflated(3.0 * told.radius)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    main(town, told.radius, told.out)
