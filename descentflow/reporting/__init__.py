"""Pages and figures of results everywhere.

Read :mod:`~descentflow.reporting.pages` first: pages are jinja2 templates that extend ``page.html.j2``. The style of
figures is :mod:`~descentflow.reporting.figure_style`; :mod:`~descentflow.reporting.figure_file` writes them to files.
"""
