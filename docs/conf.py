"""How Sphinx builds the site; ``scripts/docs`` runs it, with every warning an error."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))
sys.path.insert(0, str(HERE.parent))

from sphinx.ext.napoleon.docstring import GoogleDocstring  # noqa: E402

from descentflow.core.version import __version__  # noqa: E402

# Napoleon reads "Share of flights, as in: text" below a constant as "type: text"; here it is always text.
GoogleDocstring._consume_inline_attribute = lambda self: ("", self._dedent(self._consume_to_end()))

project = "descentflow"
author = "The descentflow authors"
project_copyright = "The descentflow authors"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinxcontrib.katex",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
    "api_pages",
    "house_map",
    "command_help",
    "browser_demo",
    "run_notebook",
]
exclude_patterns = ["_build", "tutorials"]  # the gallery's pages are made from tutorials/ into made/tutorials
root_doc = "index"
language = "en"
nitpicky = True
default_role = "code"
# Names of other libraries are not looked up: the site builds without a network.
OTHERS = (
    "abc argparse collections concurrent dataclasses datetime distributed enum functools io jinja2 joblib "
    "jsonargparse lightning markupsafe "
    "matplotlib normflows np numpy os pathlib pl polars pyro pytorch_lightning scipy sklearn torch types typing"
)
BARE = (
    "AnyAircraft Artist Axes DataclassInstance Figure None Path Tensor "
    "bool bytes callable dict float int iterable list object set str tuple type"
)
nitpick_ignore_regex = [
    (r"py:.*", rf"({OTHERS.replace(' ', '|')})\..*"),
    (r"py:.*", rf"({BARE.replace(' ', '|')})(\[.*)?"),
    # Attributes that a class explains in its own docstring are no objects of their own.
    (r"py:attr", r"(?!descentflow\.).*"),
    # Type variables and private bases have no page of their own.
    (r"py:.*", r"descentflow\..*\.([A-Z]|_\w+|Task|Kind)"),
    # Bounds of annotated numbers, and what stands for a value in the help of a command.
    (r"py:class", r"-?(inf|\d[\d.e-]*)|[A-Z]+([ =,][A-Z]+)*(\.py)?"),
]

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_inherit_docstrings = False
autodoc_default_options = {"show-inheritance": True}
python_maximum_signature_line_length = 88
add_module_names = False
toc_object_entries_show_parents = "hide"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3

sphinx_gallery_conf = {
    "examples_dirs": ["tutorials"],
    "gallery_dirs": ["made/tutorials"],
    "filename_pattern": r"/\d\d_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_signature": False,
    "remove_config_comments": True,
    "min_reported_time": 1,
    "write_computation_times": False,
    "matplotlib_animations": False,
    "image_scrapers": ("matplotlib", "gallery_figures"),
}

html_theme = "furo"
html_title = "descentflow"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["made/site"]  # made by browser_demo
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#7fb8dd", "color-brand-content": "#7fb8dd"},
}
# KaTeX's script comes with sphinxcontrib-katex; its style sheet and fonts, of the same version, are in _static.
katex_css_path = "katex/katex.min.css"
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
copybutton_exclude = ".linenos, .gp, .go"
