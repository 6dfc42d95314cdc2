"""TAS, groundspeed and distances of models that are given the temperature, by equations of their own."""

from functools import cache

import generator_toys as toy
import numpy as np
import polars as pl
import pytest
import torch

import descentflow as df
from descentflow.air.kept_air import KeptAir
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import ConfigError, DescentflowWarning
from descentflow.core.units import FL_M, KT_MPS, NM_M
from descentflow.densities import GaussianDensity
from descentflow.generation._given_temperature import given_deviation_k
from descentflow.generation.prediction.predictor import DescentPredictor
from descentflow.representation.context import ContextEncoder

WARM = 15.0


@cache
def model(name: str = "deviation_k", missing: str = "drop") -> GaussianDensity:
    """A Gaussian whose mean follows a number of the context, called by a name."""
    parts, values = toy.fitted(), [-20.0, 0.0, 20.0] if missing == "drop" else [-20.0, 0.0, 20.0, None]
    parts.context = ContextEncoder.fit(pl.DataFrame({"hour": [1.0, 2.0, 3.0, 4.0][: len(values)], name: values}),
                                       ["hour", name], missing)  # fmt: skip
    density = GaussianDensity(parts.decoder.dimension, parts.context.width)
    density.scale_tril.data = 0.3 * torch.eye(parts.decoder.dimension, dtype=torch.float64)
    density.slope.data[:, 2] = 0.1
    density.attach(parts)
    return density


def tas_kt(table: pl.DataFrame, deviation_k: float) -> np.ndarray:
    """By Mach number and the standard atmosphere's own formula."""
    temperature = np.where(table["level_fl"] < 360.89, 288.15 - 0.0065 * table["level_fl"] * 30.48, 216.65)
    return table["Mach"].to_numpy() * np.sqrt(1.4 * 287.05287 * (temperature + deviation_k)) / KT_MPS


def given(value: float | None) -> dict[str, float | None]:
    return {"hour": 2.0, "deviation_k": value}


@pytest.mark.parametrize("deviation_k", [-15.0, 0.0, WARM])
def test_true_airspeed_and_distance_are_those_of_the_given_temperature(deviation_k: float) -> None:
    table = df.sample(model(), 20, seed=1, entry_fl=350, context=given(deviation_k)).to_polars()
    assert table["TAS"].to_numpy() == pytest.approx(tas_kt(table, deviation_k), rel=1e-4)
    sample = table.filter(sample_id=3)
    level = np.sqrt(sample["TAS"].to_numpy() ** 2 - (sample["vertical_rate"].to_numpy() * 0.3048 / 60 / KT_MPS) ** 2)
    assert sample["groundspeed"].to_numpy() == pytest.approx(level)
    flown = (0.5 * (level[1:] + level[:-1]) * KT_MPS * np.diff(sample["time_s"])).sum() / NM_M
    assert sample["distance_nm"][-1] == pytest.approx(flown)


def test_nothing_else_changes_and_each_sample_has_its_own_temperature() -> None:
    rows = pl.DataFrame({"hour": [2.0, 2.0], "deviation_k": [-WARM, WARM]})
    warm = df.sample(model(), 30, seed=1, context=rows)
    plain = df.sample(model("other"), 30, seed=1, context=rows.rename({"deviation_k": "other"}))
    for name in ("time_s", "cas_mps", "mach", "rate_mps", "drag_n", "entry"):
        assert torch.equal(getattr(warm.trajectories, name), getattr(plain.trajectories, name)), name
    ratio = (warm.trajectories.tas_mps / plain.trajectories.tas_mps)[:, 0]
    assert (ratio[0::2] < 1).all()
    assert (ratio[1::2] > 1).all()


def test_a_missing_temperature_is_that_of_the_standard_atmosphere() -> None:
    density = model(missing="indicator")
    encoded = density.representation.context.encode(pl.DataFrame({"hour": [1.0, 1.0], "deviation_k": [None, 10.0]}))
    assert given_deviation_k(density.representation, encoded).tolist() == pytest.approx([0, 10])
    table = df.sample(density, 5, context=given(None)).to_polars()
    assert table["TAS"].to_numpy() == pytest.approx(tas_kt(table, 0.0), rel=1e-4)


@pytest.mark.parametrize("air", [{"deviation_k": 15}, pl.DataFrame({"level_fl": [270, 370], "deviation_k": [0, 5]})])
def test_a_second_temperature_is_refused(air: object) -> None:
    with pytest.raises(
        ConfigError, match=r"next to the context's deviation_k; .* leave the temperature out of the air"
    ):
        df.sample(model(), 5, context=given(WARM), air=air)


def test_a_wind_beside_it_is_flown_and_the_table_has_the_contexts_temperature() -> None:
    table = df.sample(model(), 5, context=given(WARM), air={"tailwind_growth": 2}).to_polars()
    assert table["deviation_k"].unique().to_list() == pytest.approx([WARM])
    assert table["TAS"].to_numpy() == pytest.approx(tas_kt(table, WARM), rel=1e-4)
    assert table["tailwind"].max() > 10


def test_a_generator_meets_distances_in_the_given_air() -> None:
    asked = {"entry_fl": 350, "level": 300, "context": given(WARM)}
    middle = float(df.Generator(model()).next_batch(50, entry_fl=350, context=given(WARM)).to_polars()
                   .filter(level_fl=300)["distance_nm"].median())  # fmt: skip
    table = df.Generator(model()).next_batch(20, distance_nm=middle, **asked).to_polars()
    assert table.filter(level_fl=300)["distance_nm"].to_numpy() == pytest.approx(middle, abs=1e-3)
    assert table["TAS"].to_numpy() == pytest.approx(tas_kt(table, WARM), rel=1e-4)


def test_predictions_are_flown_in_it_too() -> None:
    flights = toy.toys.flights(2, seed=9, bottom_fl=toy.BOTTOM, top_fl=toy.TOP).subset([0])
    density, levels = model(), toy.parts().decoder.levels_fl
    encoded = density.representation.context.encode(pl.DataFrame([given(WARM)]))
    flown = DescentPredictor(density).predict(flights, 320.0, 60, context=encoded).trajectories
    temperature = 288.15 - 0.0065 * levels[:80] * FL_M + WARM
    expected = flown.mach[:, :80] * (1.4 * 287.05287 * temperature).sqrt()
    torch.testing.assert_close(flown.tas_mps[:, :80], expected, rtol=1e-4, atol=0)


def test_airs_that_are_drawn_beside_a_given_temperature_are_told() -> None:
    own = GaussianDensity(model().dimension, model().n_context)
    own.load_state_dict(model().state_dict())
    parts = toy.fitted()
    parts.context = model().representation.context
    parts.air = KeptAir("measured", False, LevelAir.uniform(parts.decoder.levels_fl, deviation_k=5.0))
    own.attach(parts)
    with pytest.warns(DescentflowWarning, match="whatever the context's deviation_k is"):
        df.sample(own, 5, context=given(WARM))
    warm = df.sample(own, 5, context=given(WARM), air={"deviation_k": WARM}).to_polars()
    assert warm["TAS"].to_numpy() == pytest.approx(tas_kt(warm, WARM), rel=1e-4)
