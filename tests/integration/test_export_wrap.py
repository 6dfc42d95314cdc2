"""Samples in OpenAP's WRAP file, read back by OpenAP itself."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy import stats

import descentflow as df
from descentflow.core.errors import DescentflowWarning
from descentflow.core.units import KT_MPS
from descentflow.exports.constant_speeds import constant_speeds
from descentflow.exports.export import export
from descentflow.exports.wrap_models import fitted_model

READERS = {
    "de_v_mach_const": "descent_const_mach",
    "de_v_cas_const": "descent_const_vcas",
    "de_vs_avg_cas_const": "descent_vs_concas",
}


@pytest.fixture
def openap() -> object:
    return pytest.importorskip("openap", reason="OpenAP is an extra of descentflow (openap)")


def test_openap_reads_the_descents_of_the_samples(a320: Path, tmp_path: Path, openap, monkeypatch) -> None:
    own = openap.WRAP(ac="A320")
    export(a320, "wrap", tmp_path / "a320.txt", n=600, seed=1, to_go_nm=40.0)
    monkeypatch.setattr(openap.kinematic, "dir_wrap", f"{tmp_path}/")
    again = openap.WRAP(ac="A320")
    assert again.cruise_mach() == own.cruise_mach(), "other phases stay OpenAP's"
    assert again.descent_vs_post_concas() == own.descent_vs_post_concas()
    parts = constant_speeds(df.sample(a320, 600, seed=1).to_polars())
    values = {
        "de_v_mach_const": parts["mach"],
        "de_v_cas_const": parts["cas_kt"] * KT_MPS,
        "de_vs_avg_cas_const": parts["cas_rate_fpm"] * 0.3048 / 60,
    }
    for name, reader in READERS.items():
        row, known = getattr(again, reader)(), values[name].drop_nulls().to_numpy()
        assert row != getattr(own, reader)()
        low, high = np.quantile(known, [0.05, 0.95])
        assert (row["minimum"], row["maximum"]) == pytest.approx((low, high), rel=1e-3)
        assert low <= row["default"] <= high
        family = getattr(stats, row["statmodel"])(*row["statmodel_params"])
        mean, spread = float(family.mean()), float(family.std())
        # Fitted to these very values: means agree far within their standard error of 4 % of the spread.
        assert mean == pytest.approx(known.mean(), abs=0.1 * known.std())
        assert spread == pytest.approx(known.std(), rel=0.15)
    reach = df.sample(a320, 600, seed=1).placed(to_go_nm=40.0).to_polars()["top_of_descent_nm"].unique()
    assert again.descent_range()["minimum"] > 1.852 * (reach.min() - 0.1)


def test_a_type_that_openap_lacks_has_the_descent_alone(a320: Path, tmp_path: Path, openap) -> None:
    model = df.load(a320)
    decoder = model.representation.decoder
    decoder.aircraft = replace(decoder.aircraft, typecode="ZZZZ")
    with pytest.warns(DescentflowWarning, match="OpenAP has no WRAP of ZZZZ"):
        export(model, "wrap", tmp_path / "zzzz.txt", n=200)
    names = [line.split()[0] for line in (tmp_path / "zzzz.txt").read_text().splitlines()]
    assert names[0] == "variable"
    assert set(names[1:]) >= {"de_d_range", "de_v_cas_const"}
    assert all(name.startswith("de_") for name in names[1:])


def test_mach_and_cas_are_told_apart_at_the_level_where_they_change() -> None:
    level = np.arange(350, 149, -1)
    mach = np.where(level > 290, 0.78, 0.78 - 0.0012 * (290 - level))
    cas = np.where(level > 290, 290 - 0.4 * (level - 290), 290.0)
    table = pl.DataFrame(
        {"sample_id": 0, "level_fl": level, "time_s": 3.0 * (350 - level), "Mach": mach, "CAS": cas}
    ).with_columns(top_of_descent_nm=70.0)
    found = constant_speeds(table).row(0, named=True)
    assert found["crossover_fl"] == pytest.approx(290, abs=2)
    assert found["mach"] == pytest.approx(0.78, abs=1e-4)
    assert found["cas_kt"] == pytest.approx(290.0, abs=0.1)
    assert found["cas_rate_fpm"] == pytest.approx(-2000.0)


@pytest.mark.parametrize(
    ("family", "parameters"), [("norm", (140.0, 5.0)), ("gamma", (2.0, 120.0, 6.0)), ("beta", (2.0, 5.0, 0.7, 0.1))]
)
def test_a_distribution_is_fitted_as_it_was_drawn(family: str, parameters: tuple[float, ...]) -> None:
    """4,000 draws: Kolmogorov-Smirnov at 1.63 / sqrt(n) is exceeded by one fit in a hundred, and the seed is fixed."""
    known = getattr(stats, family)(*parameters)
    values = known.rvs(4000, random_state=3)
    found = fitted_model(values)
    distance = stats.kstest(values, getattr(stats, found.kind)(*found.parameters).cdf).statistic
    assert distance < 1.63 / np.sqrt(len(values))
    assert (found.low, found.high) == pytest.approx(known.ppf([0.05, 0.95]), rel=0.03)
