"""The split comes before every fit, statistics come from training flights alone, and bad data are refused."""

from pathlib import Path

import polars as pl
import pytest
import torch
import toys
from refusals import refuses

from descentflow.core.errors import ConfigError, DataError, DescentflowWarning
from descentflow.representation.flight_parts import top_level
from descentflow.representation.plausibility import level_bounds
from descentflow.representation.profiles import Profiles
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.splitting import SplitSettings, split_flights


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("data") / "a320.parquet", 240)


def module(descents: Path, **settings: object) -> DescentDataModule:
    data = DescentDataModule(descents, **settings)
    data.setup()
    return data


def rewritten(source: Path, target: Path, change: pl.Expr | None = None, keep: pl.Expr | None = None) -> Path:
    """A copy of a prepared file with columns changed or rows dropped."""
    frame, metadata = pl.read_parquet(source), pl.read_parquet_metadata(source)["descentflow"]
    frame = frame if keep is None else frame.filter(keep)
    frame = frame if change is None else frame.with_columns(change)
    frame.write_parquet(target, metadata={"descentflow": metadata})
    return target


def test_parts_are_80_to_20_and_share_no_flight(descents: Path) -> None:
    data = module(descents)
    parts = {name: set(data.profiles(name).flight_ids) for name in ("train", "validation", "test")}
    assert [len(parts[name]) for name in ("train", "validation", "test")] == [173, 19, 48]
    assert len(set.union(*parts.values())) == 240


def test_the_split_repeats_and_does_not_depend_on_the_order_of_flights() -> None:
    ids = [f"f{i}" for i in range(50)]
    settings = SplitSettings(seed=3)
    first = split_flights(ids, ids, settings)
    assert first == split_flights(ids[::-1], ids[::-1], settings)
    assert first != split_flights(ids, ids, SplitSettings(seed=4))


def test_flights_of_one_aircraft_stay_together(descents: Path) -> None:
    data = module(descents, split_by="aircraft")
    owner = dict(pl.read_parquet(descents).select("flight_id", "icao24").unique().iter_rows())
    owners = [{owner[f] for f in data.profiles(part).flight_ids} for part in ("train", "validation", "test")]
    assert owners[0].isdisjoint(owners[1] | owners[2])
    assert owners[1].isdisjoint(owners[2])


def test_nothing_is_fitted_to_held_out_flights(descents: Path, tmp_path: Path) -> None:
    """Doubling the speed of every held-out flight changes no basis, scaler or bound."""
    before = module(descents).representation
    held_out = pl.col("flight_id").is_in(before.split.test + before.split.validation)
    faster = pl.when(held_out).then(pl.col("IAS") * 1.2).otherwise("IAS").alias("IAS")
    after = module(rewritten(descents, tmp_path / "changed.parquet", faster)).representation
    assert after.split == before.split
    for name in ("decoder", "plausibility"):
        changed = dict(getattr(after, name).named_buffers())
        for key, buffer in getattr(before, name).named_buffers():
            assert torch.equal(buffer, changed[key]), key


@pytest.mark.parametrize(("grid_top", "needed"), [("quarter", 44), ("shown", 20)])
def test_the_grid_ends_where_enough_of_the_training_flights_still_reach(
    descents: Path, grid_top: str, needed: int
) -> None:
    """A quarter of 173 training flights, as in the paper, or twenty of them."""
    data = module(descents, grid_top=grid_top)
    train, top = data.profiles("train"), float(data.representation.decoder.levels_fl[-1])
    frame = pl.read_parquet(descents).filter(pl.col("flight_id").is_in(train.flight_ids))
    reached = frame.group_by("flight_id").agg(pl.col("level_fl").max())["level_fl"]
    assert (reached >= top).sum() >= needed
    assert top == reached.max() or (reached >= top + 1).sum() < needed


@pytest.mark.parametrize(("n", "needed"), [(40, 10), (200, 20), (2000, 40)])
def test_few_flights_end_the_grid_by_a_quarter_and_many_by_two_in_a_hundred(n: int, needed: int) -> None:
    mask = torch.arange(n) < torch.arange(n, 0, -1)[:, None]  # each level is the highest of one flight
    nothing = torch.zeros(n, n)
    levels_fl = torch.arange(100.0, 100.0 + n)
    flights = Profiles(tuple(map(str, range(n))), levels_fl, nothing, nothing, nothing, nothing, mask)
    assert int((levels_fl[flights.entry_level] >= top_level(flights)).sum()) == needed


@pytest.mark.parametrize(
    ("hidden", "grid"), [((360, 369), (150, 359)), ((100, 160), (161, 370)), ((180, 200), (201, 370))]
)
def test_the_grid_ends_where_two_training_flights_are_left(
    descents: Path, tmp_path: Path, hidden: tuple[int, int], grid: tuple[int, int], caplog: pytest.LogCaptureFixture
) -> None:
    """At both ends, and at a gap, beyond which the part is taken that shows most."""
    one = pl.col("flight_id") == module(descents).representation.split.train[0]
    data = module(rewritten(descents, tmp_path / "some.parquet", keep=one | ~pl.col("level_fl").is_between(*hidden)))
    assert data.representation.decoder.levels_fl[[0, -1]].tolist() == list(grid)
    assert (data.profiles("train").mask.sum(0) >= 2).all()
    assert f"grid FL{grid[0]}-{grid[1]}, not FL150-" in caplog.text
    every = data.of_all_flights()
    every.setup()
    assert torch.equal(every.representation.decoder.levels_fl, data.representation.decoder.levels_fl)


def test_lower_bottom_and_other_mass(descents: Path) -> None:
    data = module(descents, bottom_fl=200, mass_kg=60_000.0)
    assert float(data.representation.decoder.levels_fl[0]) == 200
    assert data.representation.decoder.aircraft.mass_reference_kg == 60_000.0
    flown = data.representation.decoder(data.weights("test"))
    assert bool(flown.time_s[:, 0].isfinite().all())


def test_a_bottom_below_the_descents_is_named(descents: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"data.bottom_fl 100 below the descents, which end at FL150; .*bottom-fl 100"
    ):
        module(descents, bottom_fl=100)


def test_a_pool_of_types_needs_an_aircraft(descents: Path, tmp_path: Path) -> None:
    other = pl.when(pl.col("flight_id") > "toy-0-00100").then(pl.lit("A321")).otherwise("typecode").alias("typecode")
    pool = rewritten(descents, tmp_path / "pool.parquet", other)
    refuses(ConfigError, "2 types", module, pool)
    assert len(module(pool, aircraft="A320").weights("train")) == 173
    assert len(module(pool, typecodes=["A321"]).weights("train")) < 173
    assert len(module(pool, typecodes="A321").weights("train")) == len(
        module(pool, typecodes=["A321"]).weights("train")
    )
    refuses(DataError, "no descent of B738", module, pool, typecodes=["B738"])
    with pytest.warns(
        DescentflowWarning, match=r"no descent of type A321X, which data.typecodes asks for.* A320, A321"
    ):
        module(pool, typecodes="A321,A321x")
    # What it was trained on is what was kept, so that flights of the other type are told later.
    assert module(pool, typecodes="a321").representation.provenance["typecodes"] == ["A321"]


@pytest.mark.parametrize(
    ("keep", "words"),
    [
        (pl.col("flight_id") == "toy-0-00001", "too few to split"),
        (pl.col("level_fl") < 0, "no descent in it"),
    ],
)
def test_too_little_data_is_refused(descents: Path, tmp_path: Path, keep: pl.Expr, words: str) -> None:
    refuses(DataError, words, module, rewritten(descents, tmp_path / "few.parquet", keep=keep))


def test_identical_flights_are_refused(descents: Path, tmp_path: Path) -> None:
    frame = pl.read_parquet(descents)
    one = frame.filter(pl.col("flight_id") == pl.col("flight_id").first())
    names = frame["flight_id"].unique(maintain_order=True)
    pl.concat(one.with_columns(flight_id=pl.lit(name)) for name in names).write_parquet(
        tmp_path / "same.parquet", metadata={"descentflow": pl.read_parquet_metadata(descents)["descentflow"]}
    )
    refuses(DataError, "identical", module, tmp_path / "same.parquet")


def test_a_setting_of_another_kind_is_refused_and_an_unknown_one_is_none_of_python() -> None:
    with pytest.raises(ConfigError, match=r"seed = 'one'; expected a whole number, .*help\(DataSettings\)"):
        DescentDataModule("descents.parquet", seed="one")
    with pytest.raises(TypeError, match="split_bye"):
        DescentDataModule("descents.parquet", split_bye="aircraft")


def test_before_setup() -> None:
    with pytest.raises(ConfigError, match="before setup"):
        _ = DescentDataModule(Path("absent.parquet")).representation


@pytest.mark.parametrize("margin", [0.05, 0.2])
def test_the_margin_about_the_training_flights_is_an_option(descents: Path, margin: float) -> None:
    data = module(descents, bounds="paper", **({} if margin == 0.05 else {"margin": margin}))
    train, bounds = data.profiles("train"), data.representation.plausibility
    assert torch.equal(torch.stack([bounds.cas_low, bounds.cas_high]), torch.stack(level_bounds(
        train.cas_mps, train.mask, margin)))  # fmt: skip
    assert float(bounds.slowest_rate_mps) == pytest.approx((1 - margin) * float(train.rate_mps[train.mask].max()))
