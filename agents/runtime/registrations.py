"""Planners that this process registered, sent to worker processes, which start without them.

Classes and functions of importable modules are sent by name, those of a script or a notebook by
value. Planners of installed packages need not be sent: every process finds their entry points.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import cloudpickle

from planners import Planner
from planners.registry import PLANNERS, registered

Registrations = Mapping[str, Callable[[], Planner]]
"""Constructors of planners by name."""


def sendable() -> Registrations:
    """The planners registered here, after a check that other processes can have them.

    Raises:
        OSError: a constructor cannot be sent to another process.
    """
    found = registered()
    for name, constructor in found.items():
        try:
            cloudpickle.dumps(constructor)
        except Exception as error:  # whatever an object raises when it is pickled
            raise OSError(
                f"planner {name!r} cannot be sent to worker processes ({error}); register a class "
                "or a function of a module, or work in one process"
            ) from None
    return found


def adopt(planners: Registrations) -> None:
    """Register the planners of the process that sent the work."""
    PLANNERS.update(planners)
