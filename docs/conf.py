"""The site: `pip install ".[docs]" && sphinx-build -W docs site`, without network; every code cell is executed."""

import sys
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

from generate import write_reference  # noqa: E402

from friso.version import VERSION  # noqa: E402

project, author, release, version = "friso", "the friso authors", VERSION, VERSION
extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc", "sphinx.ext.autosummary"]
html_theme = "pydata_sphinx_theme"
html_title = "friso"
html_theme_options = {"show_toc_level": 2, "navigation_with_keys": False, "secondary_sidebar_items": ["page-toc"]}
html_sidebars = {"index": [], "start": [], "stories": []}  # pages without pages below have nothing to navigate
html_static_path: list[str] = []
exclude_patterns = ["_build", "reference/generated/*"]
myst_enable_extensions = ["colon_fence", "substitution"]
myst_substitutions = {"version": VERSION}
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_timeout = 240
nb_execution_raise_on_error = True
nb_merge_streams = True
autosummary_generate = True
numpydoc_show_class_members = False
nitpicky = False

write_reference(DOCS / "reference" / "generated")
