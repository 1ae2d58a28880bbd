"""Sphinx: `pip install '.[docs]' && sphinx-build -W docs docs/_build`."""

import sys
from pathlib import Path

import numpydoc.xref

import granular

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
for module in ("bodies", "scaling", "schemes"):  # Sphinx imports modules by their public names
    sys.modules[f"granular.{module}"] = getattr(granular, module)

project = "granular"
copyright = "2026, The granular developers"
author = "The granular developers"
release = version = granular.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx-mathjax-offline",  # a copy of MathJax in the site: formulas show without a network
    "docstrings",
    "generated_tables",
    "lessons",
    "linked_names",
    "paper_lists",
    "result_tables",
]
exclude_patterns = ["_build", "_ext", "paper"]
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["granular.css"]

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # lessons are shown with the outputs that they are stored with
default_role = "py:obj"  # `Scene` in a docstring is a link where there is such a thing

autosummary_generate = True
autosummary_ignore_module_all = False
autodoc_member_order = "groupwise"
autodoc_typehints = "none"  # docstrings name the types, with their shapes and units
python_maximum_signature_line_length = 88
python_use_unqualified_type_names = True
numpydoc_show_class_members = False
numpydoc_xref_param_type = True  # `MeanForce` among the types of a docstring is a link, and
numpydoc_xref_ignore = "all"  # so are the classes below and nothing else
numpydoc.xref.DEFAULT_LINKS.clear()  # these lead to the sites of Python and NumPy
numpydoc_xref_aliases = {
    name: f"{module.__name__}.{name}"
    for module in (
        *(granular.grain_scale.friction_law, granular.grain_scale.inference, granular.sph),
        *(granular.economy, granular.theory, granular.measure, granular.materials, granular),
    )
    for name, value in vars(module).items()
    if isinstance(value, type) and value.__module__.startswith("granular.")
}
toc_object_entries_show_parents = "hide"

html_theme = "pydata_sphinx_theme"
html_title = f"granular {release}"
html_theme_options = {
    "navbar_align": "left",
    "header_links_before_dropdown": 6,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "show_toc_level": 2,
    "secondary_sidebar_items": {"**": ["page-toc"], "index": []},
    "footer_start": ["copyright"],
    "footer_end": ["sphinx-version"],
    "pygments_light_style": "default",
    "pygments_dark_style": "github-dark",
}
html_sidebars = {"index": []}
