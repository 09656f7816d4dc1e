"""Planners map a field, a state and a seed to a certified plan. They do not import gymnasium.

`plan` plans a field by the names of field and planner; `make` builds a planner by name, `PLANNERS`
lists the names, and `register` adds one. The other public names come from `planners.interface`;
`planners.contract` checks the contract that is stated there. All names are imported when they are
first used. Folders, each importing only earlier ones: `optimization` (windows of segments and their
solvers), `whole_path` (routes and the segments fitted to them), `receding_horizon` (one segment at
a time) and `wrappers` (planners that change the inputs or decisions of another planner).
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planners.interface import Decision as Decision
    from planners.interface import Knowledge as Knowledge
    from planners.interface import Plan as Plan
    from planners.interface import Planner as Planner
    from planners.interface import Replanner as Replanner
    from planners.interface import State as State
    from planners.interface import Status as Status
    from planners.registry import PLANNERS as PLANNERS
    from planners.registry import make as make
    from planners.registry import plan as plan
    from planners.registry import register as register
else:  # hidden from type checkers, which would accept any attribute
    _INTERFACE = ("Decision", "Knowledge", "Plan", "Planner", "Replanner", "State", "Status")
    _MODULES = dict.fromkeys(_INTERFACE, "planners.interface")
    _MODULES |= dict.fromkeys(("PLANNERS", "make", "plan", "register"), "planners.registry")

    def __getattr__(name):
        """Import a public name when it is first used."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return value

    def __dir__():
        return sorted({*globals(), *_MODULES})
