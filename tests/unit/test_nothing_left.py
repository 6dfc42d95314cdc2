"""Messages where cleaning leaves nothing begin with the rule that took most rows."""

import polars as pl
import pytest
from surveillance_toys import flight

from descentflow.core.errors import DataError
from descentflow.surveillance.cleaning.chain import after_rates, before_rates
from descentflow.surveillance.cleaning.drop_report_checks import REASONS, nothing_left
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.prepare import prepare
from descentflow.surveillance.rows.drop_report import DropReport, Step


def test_the_first_line_says_what_took_most_and_the_table_follows() -> None:
    steps = [Step("read", 0, None, 90, None), Step("duplicate", 5, None, 85, None), Step("not_descending", 80, 2, 5, 1)]
    first, *table = str(nothing_left(DropReport([*steps, Step("transient", 5, 1, 0, 0)]), Cleaning())).splitlines()
    assert first.startswith("no free descent is left: 80 of 90 rows do not descend at 500 ft/min or more")
    assert "negative in descent" in first
    assert table == str(DropReport([*steps, Step("transient", 5, 1, 0, 0)])).splitlines()


def test_level_flight_ends_so(tmp_path) -> None:
    rows = flight().with_columns(vertical_rate=pl.lit(-100.0), altitude=pl.lit(35_000.0), Mach=pl.lit(0.79))
    with pytest.raises(DataError, match=r"no free descent is left: [\d,]+ of [\d,]+ rows do not descend"):
        prepare(rows.with_columns(IAS=pl.lit(268.0)))


def test_every_filter_has_its_mend() -> None:
    rules = Cleaning()
    for one in (*before_rates(rules), *after_rates(rules)):
        message = str(nothing_left(DropReport([Step(one.reason, 9, 1, 0, 0)]), rules))
        assert "see what that step asks for" not in message, one.reason
    assert len({why for why, _ in REASONS.values()}) == len(REASONS)
