"""Building footprints in GeoJSON: polygons in longitude and latitude, on a plane in metres."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ferguson_gym.importers.convex_pieces import check_shapely, convex_pieces
from ferguson_gym.importers.placement import Placement
from ferguson_gym.runtime.arrays import Array, truncate_repr
from ferguson_gym.runtime.json_files import read_json
from ferguson_gym.world.cores.hulls import hulls
from ferguson_gym.world.field import Field
from ferguson_gym.world.obstacles import Obstacles

if TYPE_CHECKING:
    from shapely import Polygon

EARTH = 6_371_008.8
"""Mean radius of the Earth [m]."""
_WIDEST = 100_000.0
"""Greatest extent of footprints for which one plane is good enough [m]."""
_LEAST_AREA = 1e-12
"""Pieces of less area than this share of their squared perimeter are left out as rounding."""
_ROUNDING = 1e-3
"""Corners of footprints as near as this to each other, or to a wall, lie on it [m]: files round
coordinates, to a tenth of a millimetre with nine decimals."""
_MOST_NESTED = 32
"""Upper limit of collections within collections."""

Ring = list[tuple[float, float]]


def read_geojson(path: str | os.PathLike[str], placement: Placement | None = None) -> Field:
    """The field of a GeoJSON file of building footprints; the file's stem is its name.

    Polygons and multipolygons, with holes, are read from a geometry, a feature or a collection;
    other geometries are left out. An equirectangular projection about the middle of the footprints
    takes longitude and latitude to metres east and north of it. Footprints that overlap or share
    walls become one, and what is not convex is cut into convex pieces that overlap.

    Args:
        path: the file.
        placement: start, goal, bounds and limits.

    Raises:
        ValueError: not GeoJSON, a ring that is open or crosses itself, no footprints, footprints
            more than 100 km apart, values that `Field` refuses, or shapely is not installed; the
            message names file and feature.
        OSError: the file cannot be read.
    """
    path = Path(path)
    check_shapely()
    try:
        return _field(path, placement or Placement())
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def footprints(data: Any) -> list[Polygon]:
    """Polygons of shapely, in metres about their middle, of parsed GeoJSON.

    Raises:
        ValueError: as `read_geojson`.
    """
    import shapely

    found = list(_polygons(data))
    if not found:
        raise ValueError("no Polygon or MultiPolygon, so there are no footprints")
    every = np.concatenate([np.array(ring) for _, rings in found for ring in rings])
    low, high = every.min(axis=0), every.max(axis=0)
    if low[0] < -180.0 or high[0] > 180.0 or low[1] < -90.0 or high[1] > 90.0:
        wrong = every[(np.abs(every) > [180.0, 90.0]).any(axis=1)][0]
        raise ValueError(
            "coordinates must be longitude and latitude in degrees (WGS 84), got "
            f"({wrong[0]:g}, {wrong[1]:g})"
        )
    middle = 0.5 * (low + high)
    metres = np.radians(1.0) * EARTH * np.array([math.cos(math.radians(middle[1])), 1.0])
    if (extent := float(((high - low) * metres).max())) > _WIDEST:
        raise ValueError(
            f"footprints spread over {extent / 1000.0:.0f} km, and one plane serves up to "
            f"{_WIDEST / 1000.0:.0f} km; cut the file into smaller ones"
        )
    polygons = []
    for where, rings in found:
        shell, *holes = [(np.array(ring) - middle) * metres for ring in rings]
        polygon = shapely.Polygon(shell, holes)
        if not polygon.is_valid:
            reason, _, place = shapely.is_valid_reason(polygon).rstrip("]").partition("[")
            near = np.array(place.split()[:2] or [np.nan] * 2, dtype=np.float64) / metres + middle
            raise ValueError(
                f"{where}: the footprint is no valid polygon: {reason.lower()} near longitude "
                f"{near[0]:.6f}, latitude {near[1]:.6f}; shapely.make_valid can repair it"
            )
        polygons.append(polygon)
    return polygons


def _field(path: Path, placement: Placement) -> Field:
    import shapely

    united = shapely.union_all(_snapped(footprints(read_json(path))))
    pieces: list[Array] = []
    for polygon in shapely.get_parts(united):
        pieces += [piece for piece in convex_pieces(polygon) if _has_area(piece)]
    # corners on a straight side, but for rounding, are left out here, without a warning
    corners, _ = hulls(pieces)
    return placement.field(path.stem, Obstacles.polygons(corners))


def _snapped(polygons: list[Polygon]) -> list[Polygon]:
    """Polygons that share corners and walls exactly where they do so but for rounding.

    Otherwise a corner that lies on a neighbour's wall might leave a gap of no width beside it.
    """
    import shapely

    tree = shapely.STRtree(polygons)
    near: list[list[int]] = [[] for _ in polygons]
    for one, other in tree.query(polygons, "dwithin", _ROUNDING).T.tolist():
        if one != other:
            near[one].append(other)
    found = list(polygons)
    # corners first, each to one that is settled; then walls to all corners on them
    for earlier in (True, False):
        for k, others in enumerate(near):
            if some := [found[other] for other in others if other < k or not earlier]:
                corners = shapely.multipoints(shapely.get_coordinates(some))
                found[k] = shapely.snap(found[k], corners, _ROUNDING)
    return [one if one.is_valid else polygons[k] for k, one in enumerate(found)]


def _has_area(piece: Array) -> bool:
    (x, y), (u, v) = piece.T, np.roll(piece, -1, axis=0).T
    perimeter = np.hypot(u - x, v - y).sum()
    return bool(0.5 * abs((x * v - u * y).sum()) > _LEAST_AREA * perimeter**2)


def _polygons(
    data: Any, where: str = "the file", nested: int = 0
) -> Iterator[tuple[str, list[Ring]]]:
    """Rings of each polygon of a GeoJSON object, and a name of where it is."""
    kind = data.get("type") if isinstance(data, dict) else None
    if not isinstance(kind, str) or nested > _MOST_NESTED:
        raise ValueError(f"{where} is not a GeoJSON object with a type, got {truncate_repr(data)}")
    if kind == "FeatureCollection":
        for k, feature in enumerate(_list(data, "features", where)):
            yield from _polygons(feature, f"feature {k}", nested + 1)
    elif kind == "GeometryCollection":
        for k, geometry in enumerate(_list(data, "geometries", where)):
            yield from _polygons(geometry, f"{where}, geometry {k}", nested + 1)
    elif kind == "Feature":
        if data.get("geometry") is not None:
            yield from _polygons(data["geometry"], where, nested + 1)
    elif kind == "Polygon":
        if rings := _list(data, "coordinates", where):
            yield where, [_ring(ring, f"{where}, ring {k}") for k, ring in enumerate(rings)]
    elif kind == "MultiPolygon":
        for k, polygon in enumerate(_list(data, "coordinates", where)):
            place = f"{where}, polygon {k}"
            yield from _polygons({"type": "Polygon", "coordinates": polygon}, place, nested + 1)


def _list(data: dict[str, Any], key: str, where: str) -> list[Any]:
    if not isinstance(data.get(key), list):
        raise ValueError(f"{where}: {key} must be a list, got {truncate_repr(data.get(key))}")
    listed: list[Any] = data[key]
    return listed


def _ring(ring: Any, where: str) -> Ring:
    """Positions of a closed ring, without heights."""
    try:
        points = [(float(position[0]), float(position[1])) for position in ring]
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        raise ValueError(
            f"{where} must be a list of positions [longitude, latitude], got {truncate_repr(ring)}"
        ) from None
    if not np.isfinite(points).all():
        raise ValueError(f"{where} has a position that is not finite")
    if len(points) < 4 or points[0] != points[-1]:
        raise ValueError(
            f"{where} is open: a ring has four positions or more, and the last repeats the first"
        )
    return points
