"""Demonstrations: an expert's flights as Minari datasets, recorded and read.

`recording` flies an expert and writes a dataset, in chunks (`work`) that an interruption leaves on
disk; `episode` is one flight with all of its transitions, `minari_store` the place of datasets on
disk. `read` reads a dataset and replays its first and last flight as a check.
"""

from agents.demonstrations.reading import Demonstrations as Demonstrations
from agents.demonstrations.reading import read as read
