"""`ferguson import`: its arguments and checks."""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser, check_directory, metres, seeds, spacing
from agents.cli.completion import FILE
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.world.field import Field, to_json

if TYPE_CHECKING:
    from ferguson_gym.importers import Placement

FORMATS = {
    "geojson": (".geojson", ".json"),
    "movingai": (".map",),
    "gazebo": (".world", ".sdf", ".xml"),
    "csv": (".csv",),
}
"""Formats, and the endings of names from which they are recognised."""
_ONLY_FOR = {
    "scenario": ("movingai",),
    "pairs": ("movingai",),
    "points": ("movingai",),
    "cell": ("movingai",),
    "close_corners": ("movingai",),
    "scale": ("gazebo", "csv"),
    "start": ("geojson", "gazebo", "csv"),
    "goal": ("geojson", "gazebo", "csv"),
    "bounds": ("geojson", "gazebo", "csv"),
    "room": ("geojson", "gazebo", "csv"),
}
_SHOWN = 10
"""Number of fields that are described."""
MOST = 100_000
"""Upper limit of the fields of one command."""
HELP = "make fields of maps and worlds of other programs"
DESCRIPTION = f"""\
Make fields of building footprints in GeoJSON, of MovingAI maps with scenarios, of Gazebo worlds of
cylinders and boxes, or of tables of circles, and write each to DIR as a JSON file. Nothing is
written if one source is bad. Footprints need shapely: {installing("maps")}"""
EPILOG = """\
examples:
  ferguson import town.geojson --out fields --start 20 20 --goal 380 210
  ferguson import arena.map --out fields --pairs 0-9 --cell 2
  ferguson import world_0.world world_1.world --out fields --limit longest=1
  ferguson import trees.csv --out fields --scale 0.01"""


def add_to(import_: Parser) -> None:
    """Add the arguments."""
    import_.add_argument(
        "sources", nargs="+", type=Path, metavar="SOURCE", help="files to read", complete=FILE
    )
    shared.add_out(import_, "directory of the fields")
    endings = "; ".join(f"{name}: {', '.join(ends)}" for name, ends in FORMATS.items())
    import_.add_argument(
        "--format",
        choices=FORMATS,
        metavar="FORMAT",
        help=f"format of the sources; default: by their names' endings ({endings})",
    )
    for name in ("start", "goal"):
        import_.add_argument(
            f"--{name}",
            nargs=2,
            type=metres,
            metavar=("X", "Y"),
            help=f"{name} of the fields; default: a corner of the box around all obstacles",
        )
    import_.add_argument(
        "--bounds",
        nargs=4,
        type=metres,
        metavar=("X", "Y", "X", "Y"),
        help="least and greatest coordinates; default: the box around all obstacles, and room",
    )
    import_.add_argument(
        "--room",
        type=spacing,
        metavar="METRES",
        help="room around the obstacles; default: a tenth of the box, at most the longest segment",
    )
    import_.add_argument(
        "--scale",
        type=spacing,
        metavar="METRES",
        help="metres of a unit of the source (gazebo, csv); default: 1",
    )
    import_.add_argument(
        "--scenario",
        type=Path,
        metavar="FILE",
        help="scenario of the map (movingai); default: SOURCE.scen",
        complete=FILE,
    )
    import_.add_argument(
        "--pairs",
        type=seeds,
        metavar="N|A-B",
        help="which pairs of the scenario, from 0 (movingai); default: all",
    )
    import_.add_argument(
        "--cell",
        type=spacing,
        metavar="METRES",
        help="side of a cell (movingai); default: 3, the length of the shortest segment",
    )
    import_.add_argument(
        "--points",
        choices=("centers", "corners"),
        metavar="KIND",
        help="start and goal are centers of their cells, or upper left corners (movingai); "
        "default: centers",
    )
    import_.add_argument(
        "--close-corners",
        action="store_true",
        default=None,
        help="close the gaps of no width between blocked cells that touch at a corner, by squares "
        "of 0.02 cells (movingai)",
    )
    shared.add_limits(
        import_,
        "set a limit of the fields: {names}; another longest also scales shortest, slowest, gate "
        "and tolerance; may be given several times; default: those of the paper, and in fields "
        "with less than 60 m from start to goal their share of that distance",
    )
    import_.add_argument(
        "--fresh", action="store_true", help="replace fields of the same names in DIR"
    )
    shared.add_output_options(import_)
    import_.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Read all sources before anything is written.

    Raises:
        ValueError: a source or an option is not valid, or a field is there already.
        OSError: a source cannot be read.
    """
    from ferguson_gym.importers import Placement

    check_directory(options.out)
    formats = [options.format or _format_of(source) for source in options.sources]
    for name, allowed in _ONLY_FOR.items():
        if getattr(options, name) is not None and not set(formats) & set(allowed):
            option = f"--{name.replace('_', '-')}"
            raise ValueError(f"{option} is for {' and '.join(allowed)}, not for {formats[0]}")
    if options.scenario is not None and len(options.sources) > 1:
        raise ValueError("--scenario is for one map; give others in commands of their own")
    placement = Placement(
        start=options.start,
        goal=options.goal,
        bounds=options.bounds,
        room=options.room,
        limits=dict(options.limit),
    )
    fields: dict[str, Field] = {}
    with terminal.bar() as progress:
        task = progress.add_task("reading", total=len(options.sources))
        for source, kind in zip(options.sources, formats, strict=True):
            for field in _read(source, kind, placement, options):
                if field.name in fields:
                    raise ValueError(
                        f"a second field would be named {field.name}, that of {source}; give "
                        "sources of the same name in commands of their own"
                    )
                if len(fields) == MOST:
                    raise ValueError(f"at most {MOST} fields can be made at once; use --pairs A-B")
                fields[field.name] = field
            progress.advance(task)
    if not options.fresh:
        for name in fields:
            if (options.out / f"{name}.json").exists():
                raise ValueError(
                    f"there is a field {name}.json in {options.out}; choose another --out, or "
                    "replace it with --fresh"
                )

    def job() -> None:
        _write(fields.values(), options.out, terminal)
        for field in list(fields.values())[:_SHOWN]:
            _describe(field, terminal)
        number = len(fields)
        terminal.note(f"wrote {number} field{'s' * (number != 1)} to {options.out}")

    return job


def _format_of(source: Path) -> str:
    for name, endings in FORMATS.items():
        if source.suffix.lower() in endings:
            return name
    raise ValueError(
        f"the format of {source} is not known from its name; give --format, one of "
        f"{', '.join(FORMATS)}"
    )


def _read(
    source: Path, kind: str, placement: Placement, options: argparse.Namespace
) -> Iterator[Field]:
    from ferguson_gym import importers
    from ferguson_gym.importers.movingai import CELL, CENTERS

    scale = 1.0 if options.scale is None else options.scale
    if kind == "movingai":
        yield from importers.read_map(
            source,
            options.scenario,
            options.pairs,
            cell=CELL if options.cell is None else options.cell,
            points=options.points or CENTERS,
            close_corners=bool(options.close_corners),
            limits=placement.limits,
        )
    elif kind == "geojson":
        yield importers.read_geojson(source, placement)
    elif kind == "gazebo":
        yield importers.read_world(source, placement, scale)
    else:
        yield importers.read_circles(source, placement, scale)


def _write(fields: Iterable[Field], out: Path, terminal: Terminal) -> None:
    """Write all fields beside their places, and move them there when all are written."""
    every = list(fields)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".importing-", dir=out) as beside:
        written = []
        with terminal.bar() as progress:
            task = progress.add_task("writing", total=len(every))
            for field in every:
                written.append(Path(beside) / f"{field.name}.json")
                to_json(field, written[-1])
                progress.advance(task)
        for path in written:
            path.replace(out / path.name)


def _describe(field: Field, terminal: Terminal) -> None:
    """Say what a field is, and how long its segments may be."""
    limits, (width, depth) = field.limits, field.bounds[1] - field.bounds[0]
    terminal.show(
        f"{field.name}: {len(field.obstacles)} obstacles on {width:.4g} x {depth:.4g} m, "
        f"{field.distance:.4g} m from start to goal, segments of {limits.shortest:.3g} to "
        f"{limits.longest:.3g} m"
    )
