"""Random windows, ordinary ones and odd ones, for the tests of what solves them."""

from dataclasses import dataclass

import numpy as np

from ferguson_gym.world.field import Field
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State
from planners.optimization.initial_guesses import random_chains
from planners.optimization.window import Window, WindowSettings, final_window, horizon_window
from tests.support.random_shapes import random_shape_field

NUMBERS = (0, 1, 5, 50, 300)
PLACES = (
    "at the start",
    "anywhere",
    "in a disc",
    "on a bound",
    "outside",
    "near the goal",
    "there",
)
SPEEDS = (5.0, 0.0, 1e-12, 1e-3, 0.1, 66.0, 1000.0)
GUESSES = ("random", "coincident", "without derivatives", "a point", "steep", "huge")


@dataclass(frozen=True)
class Case:
    """A window by what is odd about it; the default is an ordinary one."""

    seed: int
    discs: int = 50
    place: str = "at the start"
    speed: float = 5.0
    guess: str = "random"
    segments: int = 3
    final: bool = False
    bending_weight: float = 0.0
    shaped: bool = False
    """Whether obstacles have every shape."""

    def draw(self) -> tuple[Window, np.ndarray]:
        """The window and a guess (segments, 4, 2)."""
        stream = np.random.default_rng(self.seed)
        shaped = random_shape_field(stream, self.discs) if self.shaped else None
        field = shaped or random_field(stream, self.discs)
        angle = stream.uniform(-np.pi, np.pi)
        along = self.speed * np.array([np.cos(angle), np.sin(angle)])
        vehicle = State(_position(stream, field, self.place), along)
        make = final_window if self.final else horizon_window
        settings = WindowSettings(bending_weight=self.bending_weight)
        window = make(field, vehicle, settings, self.segments)
        (guess,) = random_chains(stream, vehicle, self.segments, PAPER_LIMITS, 1)
        match self.guess:
            case "coincident":
                guess[:, :2] = vehicle.position
            case "without derivatives":
                guess[:, 2:] = 0.0
            case "a point":
                guess[:, :2], guess[:, 2:] = vehicle.position, 0.0
            case "steep":
                guess[:, 2:] = stream.choice([-1000.0, 1000.0], guess[:, 2:].shape)
            case "huge":
                guess *= 10.0 ** stream.uniform(1.0, 300.0)
        return window, guess


def random_case(stream: np.random.Generator) -> Case:
    """One case in some thousands."""
    return Case(
        seed=int(stream.integers(2**32)),
        discs=int(stream.choice(NUMBERS)),
        place=str(stream.choice(PLACES)),
        speed=float(stream.choice(SPEEDS)),
        guess=str(stream.choice(GUESSES)),
        segments=int(stream.integers(1, 5)),
        final=bool(stream.integers(2)),
        bending_weight=float(stream.choice([0.0, 0.0, 0.01])),
    )


def random_field(stream: np.random.Generator, discs: int) -> Field:
    """Discs of all sizes that may overlap, none of them on the start or the goal."""
    centers = stream.uniform(-10.0, 110.0, (discs, 2))
    radii = np.exp(stream.uniform(np.log(0.05), np.log(12.0), discs))
    start, goal = stream.uniform(-5.0, 105.0, (2, 2))
    clear = np.ones(discs, np.bool_)
    for point in (start, goal):
        clear &= np.linalg.norm(centers - point, axis=1) >= radii
    return Field(
        name="random",
        obstacles=Obstacles.discs(centers[clear], radii[clear]),
        start=start,
        goal=goal,
    )


def _position(stream: np.random.Generator, field: Field, place: str) -> np.ndarray:
    position = stream.uniform(-10.0, 110.0, 2)
    centers, radii = field.obstacles.balls
    coordinate = stream.integers(2)
    match place:
        case "at the start":
            return field.start
        case "in a disc" if len(radii):
            disc = stream.integers(len(radii))
            off = stream.choice([0.0, 1.0]) * stream.normal(0.0, 0.4, 2)
            return np.asarray(centers[disc] + off * radii[disc])
        case "on a bound":
            aside = stream.choice([0.0, 1e-9, -1e-9, 1e-3, -1e-3])
            position[coordinate] = stream.choice([-10.0, 110.0]) + aside
        case "outside":
            away = stream.uniform(0.0, 50.0)
            position[coordinate] = stream.choice([-10.0 - away, 110.0 + away])
        case "near the goal":
            return field.goal + stream.normal(0.0, 2.0, 2)
        case "there":
            return field.goal
    return position
