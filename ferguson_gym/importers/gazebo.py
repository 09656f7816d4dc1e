"""Worlds of cylinders, spheres and boxes in Gazebo's XML (SDF), seen from above."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from ferguson_gym.importers.placement import Placement
from ferguson_gym.runtime.arrays import truncate_repr
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

_UPRIGHT = 1e-3
"""Greatest roll and pitch that count as upright [rad]."""
_HARMLESS = ("model://ground_plane", "model://sun")
"""Models that are included without being in the way."""
_MOST_NESTED = 16
"""Upper limit of models within models."""


class Pose(NamedTuple):
    """Place and heading on the ground."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def then(self, other: Pose) -> Pose:
        """The pose that is `other`, seen from this one."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(
            self.x + cosine * other.x - sine * other.y,
            self.y + sine * other.x + cosine * other.y,
            self.yaw + other.yaw,
        )


def read_world(
    path: str | os.PathLike[str], placement: Placement | None = None, scale: float = 1.0
) -> Field:
    """The field of a Gazebo world; the file's stem is its name.

    The collision shapes of all models are seen from above, whatever their heights: cylinders and
    spheres are discs, boxes are rectangles, planes are left out. Poses of models, links and
    collisions are composed; a pose in the world's `state` replaces that of the model.

    Args:
        path: the `.world` or `.sdf` file.
        placement: start, goal, bounds and limits.
        scale: metres of a unit of the file.

    Raises:
        ValueError: not such a file, a document type or entities, shapes of other kinds, lying down
            or scaled, poses in frames other than that of the parent, or values that `Field`
            refuses; the message names file and model.
        OSError: the file cannot be read.
    """
    path = Path(path)
    text = path.read_bytes()
    try:
        _refuse_entities(text)
        root = ElementTree.fromstring(text)
        parts = list(_shapes_in(root))
        if not parts:
            raise ValueError("no collision of a model is a cylinder, sphere or box")
        obstacles = Obstacles.joined(parts).rescaled(np.zeros(2), scale)
        return (placement or Placement()).field(path.stem, obstacles)
    except (ElementTree.ParseError, expat.ExpatError) as error:
        raise ValueError(f"{path}: not XML: {error}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _refuse_entities(text: bytes) -> None:
    """Refuse documents that declare a type, and with it entities, which can grow without end."""

    def refuse(*_: object) -> None:
        raise ValueError("a document type or entities are declared, which worlds do not need")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.Parse(text, True)


def _shapes_in(root: ElementTree.Element) -> Iterator[Obstacles]:
    if root.tag not in ("sdf", "gazebo"):
        raise ValueError(f"not a Gazebo world, whose outermost element is sdf, got {root.tag}")
    for world in [root, *root.findall("world")]:
        moved: dict[str | None, Pose] = {}
        for model in world.findall("state/model"):
            where = f"the state of model {truncate_repr(model.get('name'))}"
            scale = model.findtext("scale")
            if scale and _numbers(scale, 3, f"{where}: scale") != [1.0, 1.0, 1.0]:
                raise ValueError(f"{where} has the scale {scale.strip()}; it must be 1 1 1")
            if model.find("pose") is not None:
                moved[model.get("name")] = _pose(model, where)
        for include in world.findall("include"):
            uri = (include.findtext("uri") or "").strip()
            if uri not in _HARMLESS:
                raise ValueError(
                    f"the world includes {truncate_repr(uri)}, whose shape is in another file; "
                    "put the model itself there"
                )
        for model in world.findall("model"):
            yield from _shapes_of(model, Pose(), moved.get(model.get("name")))


def _shapes_of(
    model: ElementTree.Element, parent: Pose, moved: Pose | None = None, nested: int = 0
) -> Iterator[Obstacles]:
    """Shapes of a model, whose own pose a pose in the world may replace."""
    name = f"model {truncate_repr(model.get('name'))}"
    if nested > _MOST_NESTED:
        raise ValueError(f"more than {_MOST_NESTED} models within each other")
    pose = parent.then(_pose(model, name)) if moved is None else moved
    if model.find("include") is not None:
        raise ValueError(f"{name} includes another model; put the model itself there")
    for link in model.findall("link"):
        of_link = f"{name}, link {truncate_repr(link.get('name'))}"
        placed = pose.then(_pose(link, of_link))
        for collision in link.findall("collision"):
            where = f"{of_link}, collision {truncate_repr(collision.get('name'))}"
            shape = _shape(collision, placed.then(_pose(collision, where)), where)
            if shape is not None:
                yield shape
    for inner in model.findall("model"):
        yield from _shapes_of(inner, pose, None, nested + 1)


def _shape(collision: ElementTree.Element, pose: Pose, where: str) -> Obstacles | None:
    """The obstacle that a collision is, seen from above; None: a plane, or without a shape."""
    geometry = collision.find("geometry")
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) > 1:
        raise ValueError(f"{where} has {len(shapes)} shapes; it may have one")
    if not shapes or shapes[0].tag in ("plane", "empty"):
        return None
    (shape,) = shapes
    if shape.tag in ("cylinder", "sphere"):
        (radius,) = _numbers(shape.findtext("radius"), 1, f"{where}: radius")
        if radius <= 0.0:
            raise ValueError(f"{where}: a radius must be above 0, got {radius:g}")
        return Obstacles.discs([[pose.x, pose.y]], [radius])
    if shape.tag != "box":
        raise ValueError(
            f"{where} is a {shape.tag}; shapes must be cylinders, spheres, boxes or planes"
        )
    width, depth, _ = _numbers(shape.findtext("size"), 3, f"{where}: size")
    if width <= 0.0 or depth <= 0.0:
        raise ValueError(f"{where}: sides must be above 0, got {width:g} and {depth:g}")
    corners = [
        pose.then(Pose(0.5 * x * width, 0.5 * y * depth))[:2]
        for x, y in ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    ]
    return Obstacles.polygons([corners])


def _pose(element: ElementTree.Element, where: str) -> Pose:
    """Place and yaw of an element, whose roll and pitch must be zero."""
    given = element.find("pose")
    if given is None or not (given.text or "").strip():
        return Pose()
    for name in ("frame", "relative_to"):
        if given.get(name):
            raise ValueError(
                f"{where}: its pose is in the frame {truncate_repr(given.get(name))}; poses must "
                "be in the frame of the element around"
            )
    if given.get("rotation_format", "euler_rpy") != "euler_rpy" or given.get("degrees") == "true":
        raise ValueError(f"{where}: a pose must be x y z roll pitch yaw in metres and radians")
    x, y, _, roll, pitch, yaw = _numbers(given.text, 6, f"{where}: pose")
    if max(abs(math.remainder(roll, math.pi)), abs(math.remainder(pitch, math.pi))) > _UPRIGHT:
        raise ValueError(
            f"{where} lies or leans (roll {roll:g}, pitch {pitch:g}); only upright shapes, turned "
            "by yaw, can be seen from above"
        )
    return Pose(x, y, yaw)


def _numbers(text: str | None, number: int, where: str) -> list[float]:
    words = (text or "").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != number or not all(map(math.isfinite, numbers)):
        raise ValueError(
            f"{where} must be {number} number{'s' * (number > 1)}, got {truncate_repr(text)}"
        )
    return numbers
