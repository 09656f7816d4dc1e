"""How `make docs` builds the documentation; pages are Markdown, the reference is generated."""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
# compiled functions would not show their signatures
os.environ["NUMBA_DISABLE_JIT"] = "1"
sys.path[:0] = [str(HERE.parent), str(HERE / "extensions")]

from ferguson_gym import __version__  # noqa: E402

project = "Ferguson Gym"
version = release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "generated_pages",
    "mathml",
    "plain_docstrings",
]
exclude_patterns = ["_build"]
# types are not written as links, and several modules have types of one name
suppress_warnings = ["ref.python"]

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_default_options = {"members": True}
# the extra `gcs` is too large to be installed for the pages
autodoc_mock_imports = ["pydrake"]
autodoc_member_order = "bysource"
maximum_signature_line_length = 80
python_use_unqualified_type_names = True
toc_object_entries = False

html_theme = "furo"
html_title = f"{project} {version}"
html_static_path = ["static"]
html_css_files = ["pages.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
