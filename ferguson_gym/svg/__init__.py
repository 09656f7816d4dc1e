"""Pictures as SVG, written as text without a drawing library, for notebooks and files.

A `Picture` is a region of the plane with obstacles, chains of segments and a caption. A Ferguson
segment is exactly one cubic Bézier command of SVG, so that pictures are small and sharp at any
size. Fields, paths, plans and flights show themselves as pictures in a notebook.
"""

from ferguson_gym.svg.notebook import ShowsPicture as ShowsPicture
from ferguson_gym.svg.picture import Picture as Picture
