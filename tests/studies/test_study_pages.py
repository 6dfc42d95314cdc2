"""Pages of studies: text is escaped, sections can be linked to, files are whole or not there."""

import pytest
from jinja2 import UndefinedError

from descentflow.reporting.pages import rendered


def test_a_name_that_a_template_does_not_get_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="report"):
        rendered("surveillance/cleaning_page.html.j2", flights=[])
