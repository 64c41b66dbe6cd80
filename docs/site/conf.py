"""Sphinx's settings; make.py copies this file beside the assembled pages."""

project = "Terragrip"
copyright = "the authors of Terragrip, Apache-2.0"
extensions = ["myst_parser"]
root_doc = "README"
myst_heading_anchors = 6
html_theme = "furo"
html_title = "Terragrip"
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_theme_options = {"top_of_page_buttons": []}
pygments_style = "friendly"
pygments_dark_style = "github-dark"
# Indented blocks are commands, formulas or YAML: shown as they are.
highlight_language = "text"
# What lies outside docs/ (examples, benchmarks) is named in the pages, and is no part of the site.
suppress_warnings = ["misc.highlighting_failure"]
