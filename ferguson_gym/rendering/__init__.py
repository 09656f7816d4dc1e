"""Drawings of fields and flights on matplotlib axes, and the environment's viewer.

`draw_field`, `draw_path` and `draw_refused` draw on given axes under the settings that `style`
returns; `plot_field` and `plot_path` also on pyplot's current axes. `Viewer` draws the frames of a
running flight, and `RecordVideo` writes them to files.
"""

from ferguson_gym.runtime.cache_directory import find_matplotlib_cache

find_matplotlib_cache()

# ruff: noqa: E402 (matplotlib reads its settings when it is imported)
from ferguson_gym.rendering.drawing import draw_field as draw_field
from ferguson_gym.rendering.drawing import draw_path as draw_path
from ferguson_gym.rendering.drawing import draw_refused as draw_refused
from ferguson_gym.rendering.drawing import style as style
from ferguson_gym.rendering.plotting import plot_field as plot_field
from ferguson_gym.rendering.plotting import plot_path as plot_path
from ferguson_gym.rendering.recording import RecordVideo as RecordVideo
from ferguson_gym.rendering.viewer import Viewer as Viewer
