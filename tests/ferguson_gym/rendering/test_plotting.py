"""Plots of fields and paths: on given axes or pyplot's, without a change of what is there."""

import subprocess
import sys
from collections.abc import Iterator

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.figure import Figure

from ferguson_gym import Field, get_field
from ferguson_gym.curves import Path
from ferguson_gym.world import Obstacles

BEND = Path([[[0, 0], [9, 3], [9, 0], [9, 6]], [[9, 3], [18, 9], [9, 6], [9, 6]]])


@pytest.fixture
def pyplot() -> Iterator[None]:
    before = mpl.get_backend()
    mpl.use("agg")
    import matplotlib.pyplot as plt

    yield
    plt.close("all")
    mpl.use(before)


def test_a_path_is_drawn_over_its_field_which_sets_the_limits() -> None:
    axes = Figure().add_subplot()
    field = get_field("paper:1")
    assert field.plot(axes) is axes
    assert BEND.plot(axes) is axes
    assert axes.get_xlim() == axes.get_ylim() == (-10.0, 110.0)
    discs, segments = axes.collections
    assert len(discs.get_paths()) == len(field.obstacles)
    assert len(segments.get_paths()) == len(BEND)


def test_obstacles_of_every_shape_are_drawn() -> None:
    axes = Figure().add_subplot()
    boxes = Obstacles.boxes([[50.0, 20.0], [10.0, 40.0]], [[60.0, 40.0], [20.0, 50.0]], [0.0, 3.0])
    shapes = Obstacles.joined([Obstacles.discs([[30.0, 30.0]], [5.0]), boxes])
    Field(name="mixed", obstacles=shapes).plot(axes)
    disc, sharp, rounded = axes.collections[0].get_paths()
    extents = [path.get_extents().get_points() for path in (disc, sharp, rounded)]
    expected = [[25, 25], [35, 35]], [[50, 20], [60, 40]], [[7, 37], [23, 53]]
    np.testing.assert_allclose(extents, expected)


def test_a_path_alone_is_seen_whole_and_undistorted() -> None:
    axes = Figure().add_subplot()
    BEND.plot(axes)
    assert axes.get_aspect() == 1.0
    low, high = axes.get_xlim()
    assert low <= 0.0 < 18.0 <= high


@pytest.mark.usefixtures("pyplot")
def test_without_axes_the_current_ones_are_used() -> None:
    import matplotlib.pyplot as plt

    assert BEND.plot() is plt.gca()
    assert get_field("paper:1").plot() is plt.gca()


def test_other_dimensions_are_refused() -> None:
    solid = Field(
        name="solid",
        obstacles=Obstacles.discs(np.empty((0, 3)), []),
        start=[0, 0, 0],
        goal=[9, 9, 9],
    )
    with pytest.raises(ValueError, match="only a planar field is plotted, this one has 3 dim"):
        solid.plot()
    with pytest.raises(ValueError, match="only a planar path is plotted, this one has 1 dim"):
        Path([[[0], [1], [1], [1]]]).plot()


def test_paths_and_fields_load_matplotlib_only_when_they_are_drawn() -> None:
    code = "import sys, planners; planners.plan; assert 'matplotlib' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
