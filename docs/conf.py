"""Settings of the documentation: `make docs` builds it into docs/_build/html."""

import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from semgs import __version__  # noqa: E402

project = "SemGS"
author = "the semgs contributors"
copyright = f"{author}, Apache-2.0"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
nitpicky = False
myst_heading_anchors = 3
myst_enable_extensions = ["dollarmath", "colon_fence"]

html_theme = "furo"
html_title = f"SemGS {version}"
repository = os.environ.get("GITHUB_REPOSITORY")
html_theme_options = (
    {"source_repository": f"https://github.com/{repository}", "source_branch": "main", "source_directory": "docs/"}
    if repository
    else {}
)
autodoc_typehints = "description"
autodoc_member_order = "bysource"
