"""Sphinx: `pip install '.[docs]' && sphinx-build -W docs docs/_build`."""

from importlib.metadata import version as _version

project = "granular"
copyright = "2026, The granular developers"
author = "The granular developers"
release = version = _version("granular")

extensions = ["myst_parser"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build", "paper"]
html_title = f"granular {release}"
