"""Style of figures and builder of HTML pages, for results everywhere.

Read :mod:`~descentflow.reporting.html_page` first (a page and its sections), then
:mod:`~descentflow.reporting.html_elements` (what a section holds: paragraphs, lists, tables) and
:mod:`~descentflow.reporting.html_figures`. The pages' one style sheet is :mod:`~descentflow.reporting.page_style`, the
figures' one style :mod:`~descentflow.reporting.figure_style`; :mod:`~descentflow.reporting.number_text` writes numbers
for readers.
"""
