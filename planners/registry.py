"""Planners by name, and the options that a name may carry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ferguson_gym.runtime.optional_dependencies import require
from ferguson_gym.runtime.suggestions import did_you_mean
from planners.interface import Iterations, Planner, Replanner
from planners.optimization.initial_guesses import Proposer
from planners.optimization.sqp.multi_start import MultiStart
from planners.receding_horizon.guided import Guided
from planners.receding_horizon.paper import RecedingHorizon
from planners.receding_horizon.pursuit import Pursuit
from planners.whole_path.astar import AStar
from planners.whole_path.exact import ShortestPathRouter
from planners.whole_path.ompl import Ompl
from planners.whole_path.planner import WholePath
from planners.whole_path.swarm import bees, particles
from planners.whole_path.voronoi import VoronoiEdges
from planners.wrappers.backtracking import Backtracking
from planners.wrappers.limited_sensing import Sensing
from planners.wrappers.safety_margin import Margin


def single_start() -> RecedingHorizon:
    """The paper's planner from the shifted plan alone, caught where that is."""
    return RecedingHorizon(random_starts=0, solver=MultiStart(sidesteps=()))


def multi_start() -> RecedingHorizon:
    """The paper's planner from the shifted plan and 10 random feasible starts."""
    return RecedingHorizon()


def shortest() -> WholePath:
    """The exact shortest path, fitted."""
    return WholePath(router=ShortestPathRouter())


def voronoi() -> WholePath:
    """The Voronoi diagram of the obstacles' centres, fitted."""
    return WholePath(router=VoronoiEdges())


def astar() -> WholePath:
    """A* on a grid, pulled tight and fitted.

    Raises:
        ValueError: networkx is not installed.
    """
    require("astar", "networkx", "networkx")
    return WholePath(router=AStar())


def rrt() -> WholePath:
    """A rapidly exploring random tree, from OMPL."""
    return WholePath(router=Ompl(algorithm="rrt", budget=Iterations(100_000)))


def rrt_star() -> WholePath:
    """RRT*, from OMPL."""
    return WholePath(router=Ompl(algorithm="rrt-star", budget=Iterations(12_000)))


def prm() -> WholePath:
    """A probabilistic roadmap, from OMPL."""
    return WholePath(router=Ompl(algorithm="prm", budget=Iterations(10_000)))


def bit_star() -> WholePath:
    """Batch informed trees, BIT*, from OMPL."""
    return WholePath(router=Ompl(algorithm="bit-star", budget=Iterations(40)))


def pso() -> WholePath:
    """Particle swarms that move the whole flight, fitted.

    Raises:
        ValueError: pygmo is not installed.
    """
    require("pso", "pygmo", "pygmo")
    return WholePath(router=particles())


def abc() -> WholePath:
    """Artificial bee colonies that move the whole flight, fitted.

    Raises:
        ValueError: pygmo is not installed.
    """
    require("abc", "pygmo", "pygmo")
    return WholePath(router=bees())


PLANNERS: dict[str, Callable[[], Planner]] = {
    "single-start": single_start,
    "multi-start": multi_start,
    "guided": Guided,
    "pursuit": Pursuit,
    "shortest": shortest,
    "voronoi": voronoi,
    "astar": astar,
    "rrt": rrt,
    "rrt-star": rrt_star,
    "prm": prm,
    "bit-star": bit_star,
    "pso": pso,
    "abc": abc,
}
"""Makers of planners by name."""


OPTIONS = "NAME+turn=METRES, NAME+backtrack, NAME+margin=METRES, NAME+sensing=METRES or several"
"""How a planner's name carries options, for people."""
_ORDER = ("turn", "backtrack", "margin", "sensing")
"""From the planner outwards: what backtracks keeps the margin, and neither knows more than is
sensed."""


def make(name: str) -> Planner:
    """The planner of this name, with the options that it carries.

    `guided+turn=3` keeps a turn radius of 3 m, `guided+sensing=20` knows the obstacles within
    20 m of where it has been, `multi-start+backtrack` is led out of the dead ends that it is
    caught in, `guided+margin=0.5` keeps half a metre from obstacles where it can.

    Raises:
        ValueError: there is none, its library is not installed, or an option is unknown, does
            not fit the planner or has a value that it refuses.

    Example:
        >>> from ferguson_gym.world.field_names import get_field
        >>> from planners.interface import initial_state
        >>> field = get_field("sparse/train:0")
        >>> plan = make("shortest").plan(field, initial_state(field), seed=0)
        >>> plan.status.sentence
        'found a feasible path to the goal'
    """
    plain, *options = name.split("+")
    if plain not in PLANNERS:
        near = did_you_mean(plain, PLANNERS)
        raise ValueError(f"unknown planner {plain!r}{near}; planners are {', '.join(PLANNERS)}")
    planner = PLANNERS[plain]()
    labels = [option.partition("=")[0] for option in options]
    if len(set(labels)) < len(labels):
        raise ValueError(f"planner {name!r} carries an option twice")
    if "turn" in labels and {"backtrack", "sensing"} & set(labels):
        raise ValueError(
            f"planner {name!r}: a turn radius is not kept where a planner backtracks or senses; "
            "leave one out"
        )
    if unknown := [option for option in options if not _is_known(option)]:
        near = did_you_mean(unknown[0].partition("=")[0], _ORDER)
        raise ValueError(
            f"unknown option {unknown[0]!r} of planner {plain!r}{near}; need {OPTIONS}"
        )
    for option in sorted(options, key=lambda option: _ORDER.index(option.partition("=")[0])):
        planner = _with_option(planner, plain, option)
    return planner


def starting_from(planner: Planner, proposer: Proposer, name: str) -> Planner:
    """A planner whose windows start from proposals.

    Args:
        planner: of the paper's kind, whatever its options.
        proposer: proposes the starts.
        name: of the planner, for people.

    Raises:
        ValueError: the planner has no starts to choose.
    """
    if isinstance(planner, RecedingHorizon):
        return replace(planner, proposer=proposer)
    if isinstance(planner, Sensing | Backtracking):
        inner = starting_from(planner.planner, proposer, name)
        assert isinstance(inner, Replanner)
        return replace(planner, planner=inner)
    raise ValueError(
        f"planner {name!r} takes no starts from an agent; single-start and multi-start do"
    )


def named(
    plain: str,
    backtrack: bool,
    sensing: float | None,
    turn: float | None,
    proposer: str | None = None,
) -> str:
    """The name of a planner with these options; sensing range and turn radius are in m.

    A proposer, a policy's name, comes last, since it may carry options of its own.
    """
    name = plain + "+backtrack" * backtrack
    for label, value in (("sensing", sensing), ("turn", turn)):
        if value is not None:
            name += f"+{label}={str(value).removesuffix('.0')}"
    return name if proposer is None else f"{name}+from={proposer}"


def _is_known(option: str) -> bool:
    label = option.partition("=")[0]
    return label in _ORDER and (label != "backtrack" or option == label)


def _with_option(planner: Planner, plain: str, option: str) -> Planner:
    label, _, value = option.partition("=")
    if label == "turn":
        if not isinstance(planner, Guided):
            raise ValueError(f"planner {plain!r} keeps no turn radius; guided does")
        return replace(planner, min_turn_radius=_metres("a turn radius", value))
    if not isinstance(planner, Replanner):
        raise ValueError(
            f"planner {plain!r} plans its whole path at once and has no option {label}; "
            "single-start, multi-start, guided and pursuit do"
        )
    if label == "backtrack":
        return Backtracking(planner=planner, guide=Guided())
    if label == "margin":
        return Margin(planner=planner, margin=_metres("a margin", value))
    return Sensing(planner=planner, reach=_metres("a sensing range", value))


def _metres(what: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise ValueError(f"{what} is a number of metres, got {value!r}") from None
