"""How Sphinx builds the site: ``sphinx-build -W --keep-going -b html docs docs/_build/html``."""

import inspect
import pkgutil
import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

import sklearn_motionsync
from members import members

project = "sklearn_motionsync"
author = "The sklearn_motionsync developers"
copyright = author
release = version = sklearn_motionsync.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "myst_plot",
    "rooms",
    "tidy",
]
exclude_patterns = ["_build", "_templates", "**.ipynb"]
templates_path = ["_templates"]
# A name in single backticks is a link where it can be imported, else a parameter.
default_role = "autolink"
nitpicky = True
nitpick_ignore_regex = [("py:obj", r"sklearn\..*")]

# -- Markdown and formulas ----------------------------------------------------------------

myst_enable_extensions = ["attrs_inline", "colon_fence", "dollarmath"]
myst_dmath_double_inline = True
myst_heading_anchors = 3
myst_update_mathjax = False
html_math_renderer = "mathml"

# -- reference ----------------------------------------------------------------------------

autosummary_generate = True
autosummary_imported_members = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
# With -W a public object without these is an error: parameters (PR) and returns (RT) described.
numpydoc_validation_checks = {"GL08", "PR01", "PR02", "PR03", "PR07", "PR10", "RT03"}
# Methods of scikit-learn.
numpydoc_validation_exclude = {r"\.set_\w+$", r"\.get_(params|metadata_routing)$"}
# What few people set is apart, under "Other Parameters"; the tests check the order within both.
numpydoc_validation_overrides = {"PR03": [r"Other Parameters\n"]}
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = {
    "Match": "sklearn_motionsync.Match",
    "Skeleton": "sklearn_motionsync.Skeleton",
}
python_maximum_signature_line_length = 88
add_module_names = False
toc_object_entries_show_parents = "hide"


def _classes():
    """Every public class by the name that the reference has for it: at the top, or in its room."""
    names = [module.name for module in pkgutil.iter_modules(sklearn_motionsync.__path__)]
    rooms = [import_module(f"sklearn_motionsync.{name}") for name in names]
    for module in (sklearn_motionsync, *rooms):
        for name in getattr(module, "__all__", ()):
            is_at_top = module is not sklearn_motionsync and name in sklearn_motionsync.__all__
            if inspect.isclass(getattr(module, name)) and not is_at_top:
                yield f"{module.__name__}.{name}", getattr(module, name)


# The templates of _templates/autosummary take the methods of a class from here.
autosummary_context = {"class_members": {name: members(cls) for name, cls in _classes()}}

# -- examples and figures -----------------------------------------------------------------

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"/plot_",
    "ignore_pattern": r"(^|/)(?!plot_)[^/]*$",
    # examples/index.rst orders the pages by task.
    "copyfile_regex": r"index\.rst",
    "minigallery_sort_order": "gallery_order.gallery_order",
    "within_subsection_order": "FileNameSortKey",
    "backreferences_dir": "reference/backreferences",
    "doc_module": ("sklearn_motionsync",),
    "reset_argv": "gallery_arguments.gallery_arguments",
    "abort_on_example_error": True,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
    "remove_config_comments": True,
}

plot_include_source = True
plot_html_show_source_link = False
plot_html_show_formats = False
plot_formats = [("png", 110)]
plot_rcparams = {
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.use": True,
    "figure.figsize": (6.4, 3.2),
    "font.size": 10,
    "grid.alpha": 0.3,
    "legend.frameon": False,
}
plot_apply_rcparams = True

# Code is copied as it is typed: without prompts, and without what it prints.
copybutton_selector = ", ".join(
    f"div.highlight-{language} pre" for language in ("default", "pycon", "Python", "python", "sh")
)
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

# -- pages --------------------------------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_title = "sklearn_motionsync"
html_static_path = ["_static"]
html_css_files = ["custom.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "sklearn_motionsync"},
    "navbar_align": "left",
    "navbar_end": ["theme-switcher"],
    "header_links_before_dropdown": 6,
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "friendly",
}
html_sidebars = {
    page: [] for page in ("index", "tutorial", "method", "design", "field", "glossary", "changelog")
}
html_context = {"default_mode": "light"}
