"""Drag at each flight's own mass: the equations, simulated flights of known mass, and models of it."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import torch
from toys import AIRCRAFT

import descentflow as df
from descentflow.air.level_air import LevelAir
from descentflow.air.measured_air import FlightAirs
from descentflow.cli import main
from descentflow.core.errors import CheckpointError, ConfigError, DataError
from descentflow.core.units import FL_M
from descentflow.densities.checkpoint_summary import checkpoint_summary
from descentflow.exports.export import export
from descentflow.physics.mass_in_drag import induced_change_n
from descentflow.representation.decoder.flown_mass import flown_at
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.kept_mass import KeptMass
from descentflow.representation.own_air import with_own_air
from descentflow.representation.own_mass import masses_of, with_own_mass
from descentflow.representation.profiles import Profiles, infer_drag_n, profiles_from_frame
from descentflow.representation.read_checkpoint import load_representation
from descentflow.simulation.world import World
from descentflow.surveillance.descents.prepared_descents import Descents, write_descents
from descentflow.training.datamodule import DescentDataModule

pytestmark = pytest.mark.usefixtures("worlds_once")

LEVELS = torch.arange(150, 331).double()
REFERENCE = float(AIRCRAFT.mass_reference_kg)


@pytest.fixture(scope="module")
def world() -> World:
    return df.simulate("A320", 120, seed=9)


@pytest.fixture(scope="module")
def descents(world: World) -> Descents:
    return df.prepare(world.rows, typecode="A320")


@pytest.fixture(scope="module")
def masses(world: World) -> pl.DataFrame:
    return world.flights.select("flight_id", "mass_kg")


@pytest.fixture(scope="module")
def checkpoint(descents: Descents, masses: pl.DataFrame, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("mass")
    masses.write_csv(folder / "masses.csv")
    data = DescentDataModule(descents, mass="mass_kg", context_table=folder / "masses.csv")
    df.fit(data, model="gaussian", out=folder / "mass.ckpt")
    return folder / "mass.ckpt", folder / "masses.csv"


def test_the_polar_takes_drag_to_another_mass() -> None:
    # By the manual's 3.6-1 to 3.6-5: D = q S CD0 + CD2 (m g)^2 / (q S), with q = kappa p M^2 / 2.
    cas, altitude = torch.tensor([[150.0, 130.0]]).double(), torch.tensor([8000.0, 5000.0]).double()
    kelvin = 288.15 - 0.0065 * altitude
    pressure = 101325 * (kelvin / 288.15) ** (9.80665 / (0.0065 * 287.05287))
    impact = (1 + 0.2 * (cas / 340.294) ** 2) ** 3.5 - 1
    mach2 = 5 * ((impact * 101325 / pressure + 1) ** (1 / 3.5) - 1)
    area = 0.7 * pressure * mach2 * AIRCRAFT.wing_area_m2
    heavy = 1.2 * REFERENCE
    expected = float(AIRCRAFT.cd2_cr) * 9.80665**2 * (heavy**2 - REFERENCE**2) / area
    found = induced_change_n(AIRCRAFT, cas, altitude, torch.tensor([heavy]).double())
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=0)


@pytest.mark.parametrize("deviation", [0.0, 12.0])
def test_drag_comes_back_from_the_rate_flown_at_a_mass(deviation: float) -> None:
    altitude, n = LEVELS * FL_M, len(LEVELS)
    cas, drag = torch.full((2, n), 145.0).double(), torch.full((2, n), 38e3).double()
    mass = torch.tensor([0.85, 1.15]).double() * REFERENCE
    entry = torch.full((2,), n - 1)
    own = drag + induced_change_n(AIRCRAFT, cas, altitude, mass)
    # The decoder's own integration at that mass, with that drag.
    flown = integrate(AIRCRAFT, LEVELS, altitude, own, cas, entry, mass[:, None], deviation)
    mask = torch.ones_like(cas, dtype=torch.bool)
    names = ("light", "heavy")
    implied = infer_drag_n(AIRCRAFT, cas, flown.rate_mps, altitude)
    profiles = Profiles(names, LEVELS, flown.time_s, cas, flown.rate_mps, implied, mask)
    if deviation:
        air = LevelAir.uniform(LEVELS, deviation).rows([0, 0])
        airs = FlightAirs(names, air, mask, 0 * cas, 0 * cas, 0)
        profiles = with_own_air(profiles, AIRCRAFT, airs, print)
    found = with_own_mass(profiles, AIRCRAFT, dict(zip(names, mass.tolist(), strict=True)), print)
    torch.testing.assert_close(found.drag_n, drag, rtol=1e-9, atol=0)
    # And back: flown at the reference mass with that drag, then at the mass.
    at_reference = integrate(AIRCRAFT, LEVELS, altitude, drag, cas, entry)
    again = flown_at(AIRCRAFT, at_reference, mass)
    standard = integrate(AIRCRAFT, LEVELS, altitude, own, cas, entry, mass[:, None])
    torch.testing.assert_close(again.rate_mps, standard.rate_mps, rtol=1e-9, atol=0)
    torch.testing.assert_close(again.drag_n, own, rtol=1e-12, atol=0)
    # Between levels the ratio of both rates is taken as linear, also in the cell of the transition.
    assert float((again.time_s - standard.time_s).abs().max()) < 0.05


def test_drag_at_the_own_mass_does_not_depend_on_it(descents: Descents, masses: pl.DataFrame) -> None:
    a320 = df.aircraft("A320")
    profiles = profiles_from_frame(descents.frame, a320, 150, 330)
    own = with_own_mass(profiles, a320, masses_of(descents.frame, "mass_kg", masses), print)
    assert own.mass_kg is not None
    log_mass = own.mass_kg.log() - own.mass_kg.log().mean()

    def slope(flights: object) -> tuple[float, float]:
        mean = (flights.drag_n.clamp(min=1).log() * flights.mask).sum(1) / flights.mask.sum(1)
        value = float((log_mass * mean).sum() / log_mass.square().sum())
        left = mean - mean.mean() - value * log_mass
        return value, float((left.square().mean() / log_mass.square().sum()).sqrt())

    # Speed and the highest level go with nothing that the mass does, so that drag at one mass has no slope: 4 sigma.
    value, error = slope(own)
    assert abs(value) < 4 * error
    value, error = slope(profiles)
    assert value < -4 * error, "inferred at one mass, heavy aircraft seem to have less drag"


def test_samples_have_the_training_flights_masses_unless_another_is_asked(checkpoint: tuple[Path, Path]) -> None:
    path, _ = checkpoint
    kept = load_representation(path).mass
    assert kept is not None
    assert kept.column == "mass_kg"
    drawn = df.sample(path, 200, seed=1, entry_fl=330)
    table = drawn.to_polars()
    assert set(np.round(table["mass_kg"].unique().to_numpy())) <= set(np.round(kept.training_kg.numpy()))
    heavy, light = (df.sample(path, 200, seed=1, entry_fl=330, mass=m) for m in (76_000, "56000"))
    assert heavy.to_polars()["mass_kg"].unique().to_list() == [76_000.0]
    # Heavier aircraft glide further: time goes with lift over drag at a speed beyond the best.
    longer = heavy.trajectories.time_s[:, 0].mean() / light.trajectories.time_s[:, 0].mean() - 1
    assert 0.05 < float(longer) < 0.3
    assert df.sample(path, 5, seed=1, mass="standard").mass_kg is None
    with pytest.raises(ConfigError, match="the mass 'heavy'"):
        df.sample(path, 5, mass="heavy")
    with pytest.raises(DataError, match="a mass of 62 kg"):
        df.sample(path, 5, mass=62)


def test_exports_say_the_mass_of_each_sample(checkpoint: tuple[Path, Path], tmp_path: Path) -> None:
    (_, path), masses = export(checkpoint[0], "bluesky", tmp_path / "s.py", n=5), df.sample(checkpoint[0], 5).mass_kg
    found = json.loads(path.read_text())
    assert masses is not None
    assert [one["mass_kg"] for one in found["samples"]] == pytest.approx(masses.tolist(), abs=1e-3)
    assert found["units"]["mass_kg"] == "kg"


def test_other_flights_bring_their_masses(
    checkpoint: tuple[Path, Path], descents: Descents, masses: pl.DataFrame, tmp_path: Path
) -> None:
    path, table = checkpoint
    write_descents(descents, tmp_path / "d.parquet")
    found = df.evaluate(path, descents, n=100, n_splits=2, context_table=table)
    assert len(found.real) == len(load_representation(path).split.test)
    some = df.evaluate(path, descents, n=100, n_splits=2, context_table=masses.head(60))
    assert len(some.real) < len(found.real)
    assert any("without a mass" in note for note in some.notes)
    words = ["evaluate", str(path), "--real", str(tmp_path / "d.parquet"), "--out", str(tmp_path / "e"), "-n", "60"]
    assert main([*words, "--no-figures"]) != 0
    out = str(tmp_path / "s.csv")
    assert main(["sample", str(path), "-n", "5", "--mass", "60000", "--out", out]) == 0
    assert pl.read_csv(out)["mass_kg"].unique().to_list() == [60000]


def test_what_is_no_mass_is_refused(descents: Descents, masses: pl.DataFrame, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="mass weight; expected standard, or columns among"):
        DescentDataModule(descents, mass="weight").setup()
    tonnes = masses.with_columns(pl.col("mass_kg") / 1000)
    with pytest.raises(DataError, match="check the unit: kg"):
        DescentDataModule(replace_column(descents, tonnes), mass="mass_kg").setup()
    with pytest.raises(DataError, match="of type String"):
        masses_of(descents.frame, "typecode")
    with pytest.raises(DataError, match="no flight with a mass"):
        masses_of(descents.frame, "mass_kg", masses.with_columns(mass_kg=pl.lit(None, pl.Float64)))
    with pytest.raises(CheckpointError):
        KeptMass.from_state({"column": "mass_kg", "training_kg": torch.tensor([-1.0])})


def replace_column(descents: Descents, table: pl.DataFrame) -> Descents:
    """The descents with the table's columns beside theirs."""
    return Descents(descents.frame.join(table, on="flight_id", how="left"), descents.metadata)


def test_what_flies_at_the_reference_mass_refuses_such_a_model(
    checkpoint: tuple[Path, Path], descents: Descents, tmp_path: Path
) -> None:
    pytest.importorskip("onnx")
    path, _ = checkpoint
    for refused in (
        lambda: df.Generator(path),
        lambda: df.export(path, "onnx", tmp_path / "model.onnx"),
        lambda: df.diagnose(descents, path),
    ):
        with pytest.raises(ConfigError, match="at each flight's own mass"):
            refused()
    assert "mass flown: of each flight, by mass_kg" in str(checkpoint_summary(path))
