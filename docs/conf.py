"""How `make docs` builds the site: Sphinx reads this file."""

import os
import sys
from pathlib import Path

from hsp_control.common.version import __version__

sys.path.insert(0, str(Path(__file__).parent / "_site"))

project = "hsp_control"
author = "the hsp_control developers"
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinxarg.ext",
    "plain_docstrings",  # from here on: docs/_site
    "mathml",
    "reference",
    "not_run",
    "replays",
    "lecture",
]
exclude_patterns = ["_build", "_site", "lecture"]
suppress_warnings = ["toc.empty_glob"]  # companions may have been taken away
smartquotes = False  # a prime is a rate
default_role = "py:obj"  # a name in backticks is a link wherever it is one of ours

# `make links` checks other sites.
linkcheck_ignore = [r"https?://(localhost|127\.|10\.|172\.16\.|192\.168\.)"]
linkcheck_anchors_ignore_for_url = [r"https://github\.com/"]
linkcheck_timeout = 20

myst_enable_extensions = [
    "dollarmath",
    "amsmath",
    "deflist",
    "attrs_inline",
    "attrs_block",
    "colon_fence",
]
myst_heading_anchors = 4
myst_ref_domains = ["std", "py"]  # not that of sphinx-argparse, which knows no "any"
myst_dmath_double_inline = True

add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
autodoc_class_signature = "mixed"
autodoc_inherit_docstrings = False
python_maximum_signature_line_length = 88

html_theme = "pydata_sphinx_theme"
html_title = f"hsp_control {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(Path(__file__).parent / "_static" / "scorer.js")
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navigation_with_keys": True,
    "show_toc_level": 2,
    "header_links_before_dropdown": 6,
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
if published := os.environ.get("HSP_SITE_VERSION"):  # beside others: tools/versions.py
    html_theme_options |= {
        "navbar_end": ["version-switcher", "theme-switcher"],
        "switcher": {"json_url": "_static/versions.json", "version_match": published},
        "check_switcher": False,
    }
copyright = "the hsp_control developers, BSD-2-Clause"
copybutton_exclude = ".linenos, .gp, .go"
