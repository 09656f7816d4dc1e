"""Demonstrations: an expert's flights as Minari datasets, recorded and read.

`recording` flies an expert and writes a dataset, in chunks (`work`), so that finished chunks
survive an interruption. `episode` is one flight with all of its transitions, and `minari_store`
knows where datasets are on disk. `read` reads a dataset and replays its first and last flight as a
check.
"""

from agents.demonstrations.reading import Demonstrations as Demonstrations
from agents.demonstrations.reading import read as read
