"""Models of drag in measured air: what they keep, what they fly in, and what refuses them."""

import warnings
from pathlib import Path

import polars as pl
import pytest
import torch
from refusals import refuses

import descentflow as df
from descentflow.air.kept_air import KeptAir
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import measured_airs
from descentflow.air.standard_air import in_standard_air
from descentflow.core.errors import CheckpointError, ConfigError, DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.densities.checkpoint import load_model
from descentflow.exports.export import export
from descentflow.generation.rejection import sample_descents
from descentflow.generation.sample_airs import air_of_table, airs_of
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.own_air import flown_in
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.training.datamodule import DescentDataModule

DAYS = WorldConfig(deviation_mean_k=5.0, deviation_spread_k=4.0, wind_slope_spread_per_s=0.001)


@pytest.fixture(scope="module")
def descents() -> Descents:
    return df.prepare(df.simulate("A320", 120, seed=6, scenario=DAYS).rows, typecode="A320")


@pytest.fixture(scope="module")
def checkpoint(descents: Descents, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("air") / "measured.ckpt"
    df.fit(DescentDataModule(descents, air="measured"), model="gaussian", out=path)
    return path


def test_samples_are_flown_in_the_training_flights_airs_unless_another_is_asked(checkpoint: Path) -> None:
    kept = load_model(checkpoint).held_out_fit.representation.air
    assert kept is not None and kept.wind  # noqa: PT018
    drawn = df.sample(checkpoint, 300, seed=1)
    assert drawn.air is not None
    # A quarter of the spread of the mean of 300 draws, four sigma: never in a fixed seed.
    spread = float(kept.training.deviation_k.mean(1).std())
    assert abs(float(drawn.air.deviation_k.mean() - kept.training.deviation_k.mean())) < 4 * spread / 300**0.5
    assert {"deviation_k", "tailwind"} < set(drawn.to_polars().columns)
    warm = df.sample(checkpoint, 300, seed=1, air={"deviation_k": 20})
    assert warm.to_polars()["deviation_k"].unique().to_list() == [20.0]
    still = df.sample(checkpoint, 300, seed=1, air="standard")
    assert still.air is None
    assert "deviation_k" not in still.to_polars().columns
    # Some 0.22 % slower for each kelvin (the energy equation at constant CAS and Mach number).
    slower = float(warm.trajectories.time_s[:, 0].mean() / still.trajectories.time_s[:, 0].mean()) - 1
    assert 0.03 < slower < 0.06


def test_one_air_flies_as_the_decoder_does_with_it(checkpoint: Path) -> None:
    parts = load_model(checkpoint).held_out_fit.representation
    density = df.load(checkpoint)
    weights, levels = density.sample(20, seed=3), parts.decoder.levels_fl
    flown = parts.decoder(weights)
    wind = torch.linspace(0, 30, len(levels), dtype=torch.float64)[None]
    air = LevelAir(LevelAir.uniform(levels, deviation_k=12.0).deviation_k, wind)
    in_air = flown_in(parts.decoder.aircraft, flown, air)
    drag_n, cas_mps = parts.decoder.curves(weights)
    altitude_m, decoder = levels * FL_M, parts.decoder
    directly = integrate(decoder.aircraft, levels, altitude_m, drag_n, cas_mps, flown.entry, None, 12.0, wind_mps=wind)
    torch.testing.assert_close(in_air.rate_mps, directly.rate_mps, rtol=1e-9, atol=0)
    torch.testing.assert_close(in_air.tas_mps, directly.tas_mps, rtol=1e-12, atol=0)
    # Between levels the ratio of both rates is taken as linear, also in the cell of the transition.
    assert float((in_air.time_s - directly.time_s).abs().max()) < 0.05


def test_a_table_by_level_and_the_wind_over_the_ground(checkpoint: Path, tmp_path: Path) -> None:
    table = pl.DataFrame({"level_fl": [150, 350, 370], "deviation_k": [0, 20, 20], "tailwind": [10.0, 50.0, 50.0]})
    table.write_csv(tmp_path / "air.csv")
    samples = df.sample(checkpoint, 20, seed=0, air=tmp_path / "air.csv", entry_fl=300)
    row = samples.to_polars().filter(level_fl=250).row(0, named=True)
    assert (row["deviation_k"], row["tailwind"]) == pytest.approx((10.0, 30.0))
    fall = row["vertical_rate"] * 0.3048 / 60 / KT_MPS
    assert row["groundspeed"] == pytest.approx((row["TAS"] ** 2 - fall**2) ** 0.5 + 30, rel=1e-6)
    placed = samples.placed(end=(52.0, 4.0), track=90.0, wind="270/30")
    refuses(ConfigError, "in a wind of their own", placed.to_polars)


def test_parquet_and_cf_say_what_the_columns_of_the_air_are(checkpoint: Path, tmp_path: Path) -> None:
    io = pytest.importorskip("arro3.io", reason="arro3 is an extra of descentflow (parquet-units)")
    netcdf = pytest.importorskip("netCDF4", reason="netCDF4 is an extra of descentflow (wind)")
    (path,) = export(checkpoint, "parquet", tmp_path / "s.parquet", n=5)
    fields = io.read_parquet(path).schema
    assert fields.field("deviation_k").metadata_str["units"] == "K"
    assert "positive from behind" in fields.field("tailwind").metadata_str["description"]
    where = {"end": (52.3, 4.76), "track": 184.0, "end_time": "2026-11-22T10:00:00Z"}
    (path,) = export(checkpoint, "cf", tmp_path / "s.nc", n=5, **where)
    with netcdf.Dataset(path) as file:
        sample = df.sample(checkpoint, 5).to_polars().filter(sample_id=2)
        assert file["deviation_k"][2].compressed() == pytest.approx(sample["deviation_k"].to_list())
        assert file["deviation_k"].units_metadata == "temperature: difference"


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"level_fl": [15_000, 37_000], "deviation_k": [5, 8]}, r"level_fl goes from 15000 to 37000; .* divide feet"),
        ({"level_fl": [0, 37_000], "deviation_k": [5, 8]}, "FL150 to FL350; to mend it, divide feet by 100"),
        ({"level_fl": [10, 100], "deviation_k": [5, 8]}, "from 10 to 100; .* levels of the model's grid"),
        (
            {"level_fl": [150, 370], "deviation_k": [5, 8], "wind": [1, 2]},
            "with level_fl, deviation_k, wind and 2 rows; expected .* tailwind",
        ),
        (
            {"level_fl": [150, 370], "deviation_k": [5, 8], "note": [1, 2]},
            "deviation_k, note and 2 rows; .* leave others out",
        ),
        (
            {"Level_FL": [150, 370], "deviation_k": [5, 8]},
            "with Level_FL, deviation_k and 2 rows; expected .* level_fl",
        ),
        ({"level_fl": [150, 370]}, "with level_fl and 2 rows; expected .* deviation_k"),
        ({"level_fl": [150, 150], "deviation_k": [5, 8]}, "a level twice"),
    ],
)
def test_a_table_of_other_levels_or_columns_is_refused(columns: dict[str, list[float]], message: str) -> None:
    refuses((ConfigError, DataError), message, air_of_table, pl.DataFrame(columns), torch.arange(150.0, 351.0))


def test_airs_that_cannot_be_are_refused(checkpoint: Path) -> None:
    parts = load_model(checkpoint).held_out_fit.representation
    refuses(ConfigError, "expected standard, training", airs_of, "hot", parts)
    refuses(ConfigError, "an air with wind", airs_of, {"wind": 3}, parts)
    refuses(ConfigError, "up to 300 K", airs_of, {"deviation_k": 300}, parts)
    refuses(ConfigError, "up to nan K", airs_of, {"deviation_k": "nan"}, parts)
    refuses(DataError, "a level twice", airs_of, pl.DataFrame({"level_fl": [1, 1], "deviation_k": [1, 2]}), parts)


def test_each_flight_is_held_against_samples_in_its_own_air(checkpoint: Path, descents: Descents) -> None:
    parts, density = load_model(checkpoint).held_out_fit.representation, df.load(checkpoint)
    n_levels, top = len(parts.decoder.levels_fl), len(parts.decoder.levels_fl) - 1
    airs = LevelAir(torch.tensor([[0.0], [30.0]]).double().expand(2, n_levels), torch.zeros(2, n_levels).double())
    entry = torch.tensor([top - 10, top])
    samples = sample_descents(density, parts, 50, 0, entry=entry, air=airs)
    assert samples.air is not None
    warm = samples.air.deviation_k[:, 0] == 30
    assert torch.equal(samples.trajectories.entry == top, warm), "an entry level comes with the air of its flight"
    assert df.evaluate(checkpoint, descents, n=200, n_splits=2).rejections.accepted == 200


def test_what_flies_in_standard_air_alone_refuses_such_a_model(
    checkpoint: Path, descents: Descents, tmp_path: Path
) -> None:
    pytest.importorskip("onnx")
    refuses(ConfigError, "a generator of single descents", df.Generator, checkpoint)
    refuses(ConfigError, "a prediction of the rest", df.predict, checkpoint, descents, from_fl=250, n=60)
    refuses(ConfigError, "an exported program", df.export, checkpoint, "onnx", tmp_path / "model.onnx")


def test_a_checkpoint_with_another_air_is_refused(checkpoint: Path, tmp_path: Path) -> None:
    for number, (name, value) in enumerate(
        (("source", "guessed"), ("deviation_k", torch.zeros(3, 7)), ("tailwind_mps", torch.tensor([[torch.nan]])))
    ):
        content = torch.load(checkpoint, weights_only=True)
        content["descentflow"]["representation"]["air"][name] = value
        path = tmp_path / f"{number}.ckpt"
        torch.save(content, path)
        with pytest.raises(CheckpointError):
            df.load(path)
    with pytest.raises(CheckpointError):
        KeptAir.from_state({}, 3)


@pytest.mark.slow
def test_a_diagnosis_does_not_name_the_weather_that_the_model_knows(tmp_path: Path) -> None:
    # Aircraft of cold still days, and others on days of ISA + 12 K with 2.4 kt more tailwind for each 1,000 ft.
    learnt = df.prepare(df.simulate("A320", 200, seed=1).rows, typecode="A320")
    weather = WorldConfig(deviation_mean_k=12.0, deviation_spread_k=3.0, wind_slope_mean_per_s=0.004)
    warm = df.prepare(df.simulate("A320", 200, seed=2, scenario=weather).rows, typecode="A320")
    for air, weather_is_named in (("standard", True), ("measured", False)):
        df.fit(DescentDataModule(learnt, air=air), model="gaussian", out=tmp_path / f"{air}.ckpt")
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            report = df.diagnose(warm, tmp_path / f"{air}.ckpt")
        named = {cause.effect for cause in report.causes}
        assert bool(named & {"temperature", "wind_gradient"}) is weather_is_named
        assert any("compared in standard air" in str(warning.message) for warning in said) is not weather_is_named


def test_flights_are_the_same_in_standard_air_whatever_air_they_flew_in() -> None:
    # One seed is the same aircraft, mass and speed in both worlds.
    a320, levels_fl = df.aircraft("A320"), torch.arange(150, 331).double()
    tables = []
    for world in (WorldConfig(), DAYS):
        frame = df.prepare(df.simulate("A320", 60, seed=6, scenario=world).rows, typecode="A320").frame
        still = in_standard_air(frame, a320, measured_airs(frame, levels_fl), levels_fl)
        took = still.group_by("flight_id").agg(seconds=pl.max("time_s") - pl.min("time_s"), levels=pl.len())
        tables.append(
            still.group_by("flight_id").agg(pl.mean("vertical_rate", "TAS", "groundspeed")).join(took, on="flight_id")
        )
    both = tables[0].join(tables[1], on="flight_id", suffix="_there").filter(pl.col("levels") == pl.col("levels_there"))
    assert len(both) > 10
    for name, allowed in (("vertical_rate", 0.01), ("TAS", 0.002), ("groundspeed", 0.004), ("seconds", 0.01)):
        apart = both[f"{name}_there"] / both[name] - 1
        assert abs(float(apart.median())) < allowed, name  # type: ignore[arg-type]
