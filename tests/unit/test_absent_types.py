"""A type that is asked for beside others, and of which there is no row, is reported and not passed over."""

from pathlib import Path

import pytest
from surveillance_toys import fleet, written

from descentflow.core.errors import DataError, DescentflowWarning
from descentflow.surveillance.prepare import prepare


def test_a_part_of_the_types_that_matches_nothing_is_told(tmp_path: Path) -> None:
    rows = written(fleet(2), tmp_path / "rows.parquet")
    words = r"no row of type B737-800, which --typecode asks for beside others; there are A320: .* as B738"
    for out in (None, tmp_path / "store"):
        with pytest.warns(DescentflowWarning, match=words):
            found = prepare(rows, typecode="a320, B737-800", out=out)
        assert found.flights == {"A320": 2}
    assert prepare(rows, typecode="a320").flights == {"A320": 2}, "without a word"
    with pytest.raises(DataError, match="no row of type B737-800; expected one of A320"):
        prepare(rows, typecode="B737-800")


def test_types_of_a_family_may_be_absent_and_are_told_in_the_report(tmp_path: Path) -> None:
    rows = written(fleet(2), tmp_path / "rows.parquet")
    found = prepare(rows, typecode="A319,A320,A321")
    assert found.metadata["report"]["notes"]["types asked for beside others, of which there is no row: A319, A321"] == 2
