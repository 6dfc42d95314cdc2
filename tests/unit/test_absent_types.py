"""Types that are asked for beside others, and of which there is no row, are reported and not passed over."""

from pathlib import Path

import pytest
from surveillance_toys import fleet, written

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.drop_report_checks import NONE_OF
from descentflow.surveillance.prepare import prepare


def test_a_part_of_the_types_that_matches_nothing_is_in_the_report(tmp_path: Path) -> None:
    rows = written(fleet(2), tmp_path / "rows.parquet")
    for out in (None, tmp_path / "store"):
        found = prepare(rows, typecode="a320, B737-800,A321", out=out)
        assert found.flights == {"A320": 2}
        assert found.report.notes[f"{NONE_OF}B737-800, A321"] == 2
    with pytest.raises(DataError, match="no row of type B737-800; expected one of A320"):
        prepare(rows, typecode="B737-800")
