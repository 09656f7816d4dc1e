"""A differentiable penalty on infeasible segments.

An error of a tenth of a metre is harmless in free space and a collision beside an obstacle, and the
likelihood of an expert's action cannot tell the two apart. The penalty is evaluated at sample
points, so it proves nothing; flights are certified by `ferguson_gym.world.feasibility`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ferguson_gym.world.actions import BEND, FINENESS, OFFSET, REACH, SHARE, SPREAD
from ferguson_gym.world.limits import PAPER_LIMITS

CLEARANCE = 0.35
"""Clearance above which obstacles cost nothing [m]."""
AHEAD_OF_END = ((1.0, 0.3), (2.0, 0.0))
"""Distances ahead of a segment's end at which space should be free, and the clearance there [m]."""
_ROOM = 0.5
"""Distance from the limits of length within which a length costs [m]."""
_SLOWEST = 1.2
"""Size of the derivative below which it costs [m per unit t]."""
_NEARLY = (0.7, 3.6)
"""Distances from the goal between which a segment should not end, since the next one could not end
on it: beyond the gate, and nearer than the shortest segment [m]."""
_SAMPLES = 12
_FAR = 1e9


def speed_of(share: Tensor) -> Tensor:
    """Size of the derivative [m per unit t] whose share an observation shows."""
    return SPREAD * torch.sinh(FINENESS * share)


def violation(
    actions: Tensor, speed: Tensor, goal: Tensor, obstacles: Tensor, present: Tensor
) -> Tensor:
    """Violation (n,) [m] of the segments that actions encode.

    The sum of the shortfalls at sample points: in clearance along the segment and just ahead of its
    end, in length beyond its limits, and in speed below a minimum, and by how much it ends too near
    the goal, yet not on it.

    Args:
        actions: (n, 4).
        speed: (n,) size of the derivative that they begin with [m per unit t].
        goal: (n, 2) in the vehicle's frame [m].
        obstacles: (n, K, 2 C + 1) corners of cores in the vehicle's frame, polygons
            counter-clockwise, repeated ones among them, and radius [m]; for discs (n, K, 3) centre
            and radius.
        present: (n, K) 1 for an obstacle, 0 for padding.
    """
    end, slope = _decoded(actions)
    start = torch.stack([speed, torch.zeros_like(speed)], dim=1)
    t = torch.linspace(1.0 / _SAMPLES, 1.0, _SAMPLES)[:, None]
    sides = end[:, None], start[:, None], slope[:, None]
    weights = (3 * t**2 - 2 * t**3, t**3 - 2 * t**2 + t, t**3 - t**2)
    slopes = (6 * t - 6 * t**2, 3 * t**2 - 4 * t + 1, 3 * t**2 - 2 * t)
    points = _weighted(weights, sides)
    pace = _size(_weighted(slopes, sides))
    onward = slope / (_size(slope)[:, None] + 1e-3)
    far, room = (end.new_tensor(column) for column in zip(*AHEAD_OF_END, strict=True))
    beyond = end[:, None] + far[:, None] * onward[:, None]
    length, short = pace.mean(dim=1), _size(goal - end)
    return (
        torch.relu(CLEARANCE - _clearance(points, obstacles, present)).sum(dim=1)
        + 0.5 * torch.relu(room - _clearance(beyond, obstacles, present)).sum(dim=1)
        + torch.relu(PAPER_LIMITS.shortest + _ROOM - length)
        + torch.relu(length - (PAPER_LIMITS.longest - _ROOM))
        + torch.relu(_SLOWEST - pace).sum(dim=1)
        + torch.relu(torch.minimum(short - _NEARLY[0], _NEARLY[1] - short))
    )


def _decoded(actions: Tensor) -> tuple[Tensor, Tensor]:
    """End points and end derivatives (n, 2) [m] in the vehicle's frame, as `actions.decode_into`.

    Written again because torch must differentiate it; a test compares both in double precision.
    """
    place = torch.complex(actions[:, 0], actions[:, 1])
    end = (place + SHARE) / (1.0 + SHARE * place)
    along = torch.sinh(FINENESS * (OFFSET + actions[:, 2]) / (1.0 + OFFSET * actions[:, 2]))
    across = torch.sinh(FINENESS * actions[:, 3])
    turn = torch.polar(torch.ones_like(along), BEND * end.imag)
    slope = SPREAD * turn * torch.complex(along, across)
    return torch.view_as_real(REACH * end), torch.view_as_real(slope)


def _weighted(weights: Sequence[Tensor], sides: Sequence[Tensor]) -> Tensor:
    return torch.stack([a * b for a, b in zip(weights, sides, strict=True)]).sum(dim=0)


def _size(vectors: Tensor) -> Tensor:
    return (vectors.square().sum(dim=-1) + 1e-6).sqrt()


def _clearance(points: Tensor, obstacles: Tensor, present: Tensor) -> Tensor:
    """Signed distance (n, m) of points (n, m, 2) to the nearest obstacle [m]."""
    corners = obstacles[:, :, :-1].reshape(*obstacles.shape[:2], -1, 2)
    if corners.shape[2] == 1:
        distance = _size(points[:, :, None] - corners[:, None, :, 0])
    else:
        distance = _core_distance(points, corners)
    distance = distance - obstacles[:, None, :, -1]
    return distance.masked_fill(present[:, None] < 0.5, 9.0).amin(dim=2)


def _core_distance(points: Tensor, corners: Tensor) -> Tensor:
    """Signed distance (n, m, K) of points (n, m, 2) from cores with corners (n, K, C, 2) [m]."""
    edges = corners.roll(-1, 2) - corners
    length = edges.square().sum(dim=-1).sqrt()
    along = edges / length.clamp_min(1e-9)[..., None]
    with torch.no_grad():  # which edge is nearest; distances of the others need no gradients
        away = points[:, :, None, None] - corners[:, None]
        share = _share(away, along[:, None], length[:, None])
        nearest = (away - share * along[:, None]).square().sum(dim=-1).argmin(dim=3)
        # an edge from a corner to itself says nothing about the inside
        height = _height(away, along[:, None]).masked_fill(length[:, None] == 0.0, -_FAR)
        highest, wall = height.max(dim=3)
        inside = (highest < 0.0) & (highest > -_FAR)
        chosen = torch.where(inside, wall, nearest)
    begin, along, length = (
        _chosen(one, chosen) for one in (corners, along, length[..., None].expand_as(corners))
    )
    away = points[:, :, None] - begin
    outside = _size(away - _share(away, along, length[..., 0]) * along)
    return torch.where(inside, _height(away, along), outside)


def _share(away: Tensor, along: Tensor, length: Tensor) -> Tensor:
    """Distance (..., 1) along edges [m] of the points nearest to points, seen from their begin."""
    share = (away * along).sum(dim=-1).clamp_min(0.0)
    return torch.minimum(share, length)[..., None]


def _height(away: Tensor, along: Tensor) -> Tensor:
    """Distance (...) of points to the right of edges [m]: polygons lie to the left of theirs."""
    return away[..., 0] * along[..., 1] - away[..., 1] * along[..., 0]


def _chosen(values: Tensor, which: Tensor) -> Tensor:
    """Those values (n, K, C, 2) that are chosen for each of m points by indices (n, m, K)."""
    every = values[:, None].expand(-1, which.shape[1], -1, -1, -1)
    index = which[..., None, None].expand(-1, -1, -1, 1, 2)
    return every.gather(3, index).squeeze(3)
