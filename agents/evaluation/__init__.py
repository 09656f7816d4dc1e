"""Evaluation of policies on the same fields: flights, statistics, tables and a report.

`evaluate` flies policies and writes a directory of results; `summarise` computes the statistics of
such a directory again. Both are imported when they are first used, because they load matplotlib.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.evaluation.run import evaluate as evaluate
    from agents.evaluation.statistics import summarise as summarise

if not TYPE_CHECKING:  # a type checker that saw it would accept any name
    _MODULES = {"evaluate": "agents.evaluation.run", "summarise": "agents.evaluation.statistics"}

    def __getattr__(name):
        """Import a public name when it is first used."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return value

    def __dir__():
        return sorted({*globals(), *_MODULES})
