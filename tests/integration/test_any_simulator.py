"""Flights of any simulator, given as rows or descents: the same answer as by checkpoint, and every way to go wrong."""

import warnings
from importlib import import_module
from pathlib import Path

import gap_toys
import polars as pl
import pytest
from refusals import refuses

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.cli.entry import main
from descentflow.core.errors import AircraftError, CheckpointError, ConfigError, DataError, DescentflowWarning
from descentflow.diagnosis.diagnose import diagnose
from descentflow.diagnosis.findings.read_gap import read_gap
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.sides.diagnosis_inputs import Inputs
from descentflow.diagnosis.sides.measured_sides import both_sides
from descentflow.effects import EFFECTS
from descentflow.measurements.quantity_registry import CHANNELS
from descentflow.simulation.world import simulate
from descentflow.simulation.world_config import WorldConfig
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, read_descents, write_descents
from descentflow.surveillance.prepare import prepare

SMALL = {name: EFFECTS[name] for name in ("temperature", "wind_gradient", "mass", "speed_schedule")}
"""A catalogue that is fitted quickly."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The "foreign" simulator's 200 flights, its checkpoint, and 120 real flights in warmer air; rows and descents."""
    place = tmp_path_factory.mktemp("any")
    for name, n, seed, config in (
        ("simulator", 200, 0, None),
        ("real", 120, 1, WorldConfig(deviation_mean_k=10.0)),
        ("same", 120, 2, None),
    ):
        simulate(open_aircraft("A320"), n, seed, config).rows.write_parquet(place / f"{name}_rows.parquet")
        write_descents(prepare(place / f"{name}_rows.parquet"), place / f"{name}.parquet")
    return place


@pytest.fixture(scope="module")
def simulator(folder: Path) -> Descents:
    return read_descents(folder / "simulator.parquet")


@pytest.fixture(scope="module")
def real(folder: Path) -> Descents:
    return read_descents(folder / "real.parquet")


@pytest.fixture(scope="module")
def by_flights(folder: Path, real: Descents, simulator: Descents) -> GapReport:
    return diagnose(real, simulator, catalogue=SMALL, out=folder / "by_flights")


def with_frame(descents: Descents, frame: pl.DataFrame) -> Descents:
    return Descents(frame, descents.metadata)


def fewer(descents: Descents, n: int) -> Descents:
    names = descents.frame["flight_id"].unique().sort().head(n)
    return with_frame(descents, descents.frame.filter(pl.col("flight_id").is_in(names.implode())))


def test_flights_give_the_verdict_that_a_checkpoint_gives(by_flights: GapReport) -> None:
    assert by_flights.verdict == "effect"
    assert [cause.effect for cause in by_flights.causes] == ["temperature"]
    size = by_flights.causes[0].parameters["deviation_k"]
    assert size.low - 0.1 < 10.0 < size.high + 0.1
    assert by_flights.details.normal_from == "simulator flights"


def test_what_both_sides_have_alike_is_no_gap(real: Descents) -> None:
    """Warm air in both: against physics it would be named, but this simulator has it."""
    frame = real.frame
    names = frame["flight_id"].unique().sort()
    halves = [frame.filter(pl.col("flight_id").is_in(part.implode())) for part in (names[:60], names[60:])]
    first, second = (with_frame(real, half) for half in halves)
    assert diagnose(first, second, catalogue=SMALL).verdict == "none"


def test_rows_files_folders_and_tables_are_the_same_flights(folder: Path, real: Descents, simulator: Descents) -> None:
    table = pl.read_parquet(folder / "simulator_rows.parquet")
    several = folder / "several"
    several.mkdir()
    for part, rows in enumerate((table.filter(pl.col("icao24") < "5"), table.filter(pl.col("icao24") >= "5"))):
        rows.write_csv(several / f"log{part}.csv")
    forms = [
        folder / "simulator.parquet",
        str(folder / "simulator_rows.parquet"),
        several,
        [several / "log0.csv", several / "log1.csv"],
        simulator,
        table,
        [table],
    ]
    opened = [Inputs(real, form).open() for form in forms]
    prints = {inputs.simulator_input.fingerprint for inputs in opened}
    assert prints == {opened[0].simulator_input.fingerprint}
    assert opened[2].simulator_input.name == "several"
    assert opened[3].simulator_input.name == "log0.csv + log1.csv"
    assert {inputs.simulator.aircraft.typecode for inputs in opened} == {"A320"}


def test_rows_of_either_side_take_the_other_side_s_settings(folder: Path) -> None:
    strict = Cleaning(slowest_fpm=1200.0, transient_s=60.0)
    write_descents(prepare(folder / "same_rows.parquet", cleaning=strict), folder / "strict.parquet")
    with warnings.catch_warnings():
        warnings.simplefilter("error", DescentflowWarning)
        opened = Inputs(folder / "strict.parquet", folder / "simulator_rows.parquet").open()
    assert opened.simulator_input.settings == opened.real_input.settings
    assert opened.real_input.settings["slowest_fpm"] == "1200.0"
    message = r"slowest_fpm is 500 in the simulator's descents and 1200 in the real descents"
    with pytest.warns(DescentflowWarning, match=message):
        Inputs(folder / "strict.parquet", folder / "simulator.parquet").open()
    with pytest.warns(DescentflowWarning, match="the cleaning settings of the simulator's descents are unknown"):
        Inputs(folder / "strict.parquet", read_descents(folder / "simulator.parquet").frame).open()


def test_a_channel_that_one_side_lacks_is_left_out_and_named(real: Descents, simulator: Descents) -> None:
    lacking = with_frame(simulator, simulator.frame.drop("TAS").with_columns(geoaltitude=pl.lit(None, pl.Float64)))
    report = diagnose(real, lacking, catalogue=SMALL)
    assert {c.channel: c.lacking for c in report.left_out_channels} == {"TAS": "simulator", "geoaltitude": "simulator"}
    assert "temperature" in report.left_out_channels[0].would_separate
    assert not {"tas", "wind", "height"} & set(report.details.quantities)
    assert "TAS is left out: the simulator's flights lack it." in str(report)
    assert "TAS would separate temperature" in str(report)
    opened = Inputs(with_frame(real, real.frame.drop("groundspeed")), simulator).open()
    sides = both_sides(opened.simulator, opened.frame, CHANNELS)
    assert sides.lacked == {"groundspeed": "real"}
    assert set(sides.real.values) == set(sides.simulated.values)


@pytest.mark.parametrize(
    ("files", "mend"),
    [
        (None, "pass the folder of your release"),
        ({}, "unpack the release there"),
        ({"B738__.OPF": "x", "SYNONYM.NEW": "no synonyms"}, "in capitals|SYNONYM|release"),
    ],
)
def test_a_bada_folder_that_cannot_be_read_is_not_mended_by_a_type(
    files: dict[str, str] | None, mend: str, simulator: Descents, real: Descents, tmp_path: Path
) -> None:
    folder = tmp_path / "bada"
    for name, text in (files or {}).items():
        folder.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    if files == {}:
        folder.mkdir()
    with pytest.raises(AircraftError, match=mend) as refused:
        diagnose(real, simulator, bada_dir=folder)
    assert "--nearest-type" not in str(refused.value)


def test_too_few_flights_of_either_side_are_refused(real: Descents, simulator: Descents) -> None:
    refuses(DataError, r"4 real flights .* at least 5 flights a side", diagnose, fewer(real, 4), simulator)
    refuses(DataError, r"4 simulated flights .* at least 5 flights a side", diagnose, real, fewer(simulator, 4))
    refuses(DataError, r"4 real flights", diagnose, fewer(real, 4), typecode="A320")
    alone = with_frame(simulator, simulator.frame.with_columns(icao24=pl.lit("abcdef")))
    refuses(DataError, r"simulated flights of 1 aircraft .* give each an icao24 of its own", diagnose, real, alone)


def test_other_types_levels_and_channels_are_refused(real: Descents, simulator: Descents) -> None:
    frame = simulator.frame
    with pytest.raises(DataError, match=r"real flights of A320 and a simulator's flights of B738"):
        diagnose(real, with_frame(simulator, frame.with_columns(typecode=pl.lit("B738"))))
    high = with_frame(simulator, frame.with_columns(pl.col("level_fl") + 300))
    refuses(DataError, r"real flights between FL150 and FL\d+, and a simulator's between FL450", diagnose, real, high)
    with pytest.raises(DataError, match=r"a simulator's with Mach, .* expected IAS and vertical_rate on both sides"):
        diagnose(real, with_frame(simulator, frame.with_columns(IAS=pl.lit(None, pl.Float64))), channels=list(CHANNELS))


def test_a_type_without_coefficients_is_asked_for(real: Descents, simulator: Descents) -> None:
    sides = [with_frame(one, one.frame.with_columns(typecode=pl.lit("B788"))) for one in (real, simulator)]
    with pytest.raises(
        AircraftError, match=r"name a type whose coefficients stand for it \(--typecode\).*nearest-type"
    ):
        Inputs(*sides).open()
    nearest = Inputs(*sides, nearest_type=True).open().simulator
    named = Inputs(*sides, typecode="A388").open().simulator
    assert (nearest.aircraft.typecode, named.aircraft.typecode) == ("B772", "A388")
    assert str(nearest.coefficients).endswith("B772's coefficients, the nearest that there are to the B788.")
    assert str(named.coefficients).endswith("A388's coefficients, which stand for the B788.")
    mixed = [
        with_frame(one, pl.concat([one.frame, two.frame.with_columns(flight_id=pl.col("flight_id") + "b")]))
        for one, two in ((real, sides[0]), (simulator, sides[1]))
    ]
    refuses(DataError, "flights of A320, B788, and no word whose coefficients", Inputs(*mixed).open)


def test_flights_of_other_types_are_counted(real: Descents, simulator: Descents) -> None:
    other = fewer(simulator, 3).frame.with_columns(typecode=pl.lit("B738"), flight_id=pl.col("flight_id") + "b")
    opened = Inputs(real, with_frame(simulator, pl.concat([simulator.frame, other]))).open()
    assert opened.dropped["simulator_flights_of_other_types"] == 3
    assert opened.simulator.flights.frame["typecode"].unique().to_list() == ["A320"]


def test_a_checkpoint_is_known_by_its_content(folder: Path, real: Descents) -> None:
    checkpoint = gap_toys.simulator(folder, folder / "simulator.parquet")
    renamed = folder / "flights_of_mine"
    renamed.write_bytes(checkpoint.read_bytes())
    assert Inputs(real, renamed).open().simulator.model is not None
    with pytest.raises(ConfigError, match=r"coefficients are to be taken, next to a checkpoint"):
        Inputs(real, checkpoint, typecode="A320").open()
    refuses(ConfigError, r"simulator.ckpt among 2 paths", Inputs(real, [checkpoint, folder / "simulator.parquet"]).open)
    refuses(CheckpointError, "no file", Inputs(real, folder / "nothing.ckpt").open)
    refuses(DataError, r"no file A320.*--typecode", Inputs(real, Path("A320")).open)
    cut = folder / "cut.ckpt"
    cut.write_bytes(checkpoint.read_bytes()[:5000])
    refuses(CheckpointError, "truncated", Inputs(real, cut).open)
    with pytest.raises(ConfigError, match="the nearest type, next to a type"):
        Inputs(real, None, typecode="A320", nearest_type=True).open()


def test_the_report_says_what_was_compared(folder: Path, by_flights: GapReport) -> None:
    written = read_gap(folder / "by_flights" / "gap.json").provenance
    assert written == by_flights.provenance
    assert (written.real.flights, written.simulator.flights) == (120, 200)
    assert written.simulator.files == ["simulator_rows.parquet"]
    assert written.simulator.first == "2024-03-04"
    assert written.coefficients.typecode == "A320"
    assert written.real.fingerprint != written.simulator.fingerprint


def test_the_command_line_takes_several_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All effects: what a user types."""
    out = folder / "typed"
    rows = [str(folder / name) for name in ("same_rows.parquet", "simulator_rows.parquet")]
    words = ["diagnose", "--real", str(folder / "real.parquet"), "--simulator", rows[1], "--channels", "TAS,Mach"]
    assert main([*words, "--typecode", "A320", "--out", str(out)]) == 0
    assert "  temperature: ISA +" in capsys.readouterr().out
    assert read_gap(out / "gap.json").provenance.simulator.name == "simulator_rows.parquet"
    assert main(["diagnose", "--real", str(folder / "real.parquet"), "--out", str(out)]) == 2
    assert "neither a simulator nor a type" in capsys.readouterr().err


def test_the_corrected_flights_close_the_gap_when_diagnosed_again(folder: Path, by_flights: GapReport) -> None:
    path = folder / "by_flights" / by_flights.corrected_file
    assert path.name == "corrected.parquet"
    corrected = read_descents(path)
    assert corrected.cleaning == read_descents(folder / "simulator.parquet").cleaning
    assert corrected.metadata["corrected"]["effects"]["temperature"][0] == pytest.approx(10.0, abs=1.5)
    again = diagnose(folder / "real.parquet", path, catalogue=SMALL)
    # The size is known to a tenth of a kelvin; a test may see that much, but no cause of the gap is left.
    assert again.causes == []
    left, was = again.gap_before - again.floor, by_flights.gap_before - by_flights.floor
    assert left < 0.05 * was


def test_the_recipe_is_in_physical_units_and_by_level(by_flights: GapReport) -> None:
    (step,) = by_flights.recipe
    assert step.text.startswith("ISA +")
    assert ", FL150 to FL" in step.text
    (number,) = step.numbers
    assert (number.unit, number.low_fl) == ("K", 150.0)
    assert number.value.low < 10.0 < number.value.high + 0.1
    assert step.share_of_flights == 1.0


def test_columns_of_either_side_and_the_simulator_are_named(
    folder: Path, tmp_path: Path, by_flights: GapReport, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in `prepare`, with units by a factor."""
    monkeypatch.setattr(import_module("descentflow.diagnosis.diagnose"), "EFFECTS", SMALL)
    pl.read_parquet(folder / "real_rows.parquet").rename({"altitude": "alt_ft"}).write_parquet(
        tmp_path / "real.parquet"
    )
    metres = pl.read_parquet(folder / "simulator_rows.parquet").with_columns(alt_m=pl.col("altitude") * 0.3048)
    metres.drop("altitude").write_parquet(tmp_path / "simulator.parquet")
    words = ["diagnose", "--real", str(tmp_path / "real.parquet"), "--simulator", str(tmp_path / "simulator.parquet")]
    named = [
        "--column",
        "altitude=alt_ft",
        "--simulator-column",
        "altitude=alt_m*3.28084",
        "--simulator-name",
        "Ours 3",
    ]
    assert main([*words, *named, "--out", str(tmp_path / "gap")]) == 0
    gap = read_gap(tmp_path / "gap" / "gap.json")
    assert gap.details.simulator == "Ours 3"
    assert "Ours 3 against 120 real A320 flights" in (tmp_path / "gap" / "gap.html").read_text()
    size, expected = (report.causes[0].parameters["deviation_k"].estimate for report in (gap, by_flights))
    assert size == pytest.approx(expected, abs=0.1)


def test_columns_that_nothing_has_are_refused(folder: Path) -> None:
    named = {"altitude": "alt_ft"}
    with pytest.raises(DataError, match="has no column alt_ft"):
        diagnose(folder / "real_rows.parquet", folder / "simulator.parquet", columns=named)
    with pytest.raises(ConfigError, match="columns of prepared descents"):
        diagnose(folder / "real_rows.parquet", folder / "simulator.parquet", simulator_columns=named)
    with pytest.raises(ConfigError, match="columns of a simulator that is not given as flights"):
        diagnose(folder / "real_rows.parquet", "A320", simulator_columns=named)
