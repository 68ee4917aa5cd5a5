"""What Sphinx is told. Nothing of it asks for anything outside: no fonts, no scripts and no index of another site."""

from importlib.metadata import version as installed

project = "Engage"
author = "the authors of Engage"
version = release = installed("engage-hri")
extensions = ["myst_parser"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "fieldlist"]
html_theme = "furo"
html_title = f"Engage {version}"
html_static_path = ["_static"]
html_css_files = ["engage.css"]
html_copy_source = False
html_show_sphinx = False
html_permalinks_icon = "#"
add_module_names = False
toc_object_entries_show_parents = "hide"
python_use_unqualified_type_names = True
maximum_signature_line_length = 88
suppress_warnings = ["misc.highlighting_failure"]  # colors of a shell session that quotes a program
nitpicky = False  # a signature names types as the source does, and not all of them have a place of their own
