"""Repair of a BADA 4 model: flights of a truth that differs from the file, and the file read back by pyBADA."""

import importlib
import shutil
from pathlib import Path

import pytest
import torch
from bada4_dummies import dummies
from lxml import etree

import descentflow as df
from descentflow.core.errors import AircraftError, ConfigError
from descentflow.diagnosis.report.page import next_command, repair_command
from descentflow.physics.airspeed import tas_to_mach
from descentflow.repairs.repair_found import Repair
from descentflow.surveillance.descents.prepared_descents import Descents

# pyBADA warns of its own.
pytestmark = pytest.mark.filterwarnings("ignore:::pyBADA")
MODEL = "Dummy-TWIN"


@pytest.fixture(scope="module")
def descents() -> Descents:
    """Flights with a fifth more drag without lift than the file, and engines that brake less at idle."""
    true = df.aircraft(MODEL, dummies()).with_factors(parasitic=1.2, idle=0.6)
    return df.prepare(df.simulate(true, 60, seed=5))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mended")


@pytest.fixture(scope="module")
def mended(descents: Descents, folder: Path) -> Repair:
    return df.repair(descents, aircraft=MODEL, bada_dir=dummies(), out=folder / "DUM2.html")


def test_an_error_is_mended_on_aircraft_that_were_not_used(mended: Repair) -> None:
    time = mended.held_out.time
    assert mended.changed
    assert time.before > 4.0
    assert abs(time.after) <= max(1.2 * time.floor, 1.0)
    parasitic = mended.estimates[0]
    assert (parasitic.name, parasitic.before) == ("parasitic", 1.0)
    assert parasitic.low < 1.2 < parasitic.high


def test_the_file_is_read_back_by_us_and_by_pybada(mended: Repair, folder: Path) -> None:
    back, after = df.aircraft("DUM2", folder), mended.after
    state = torch.tensor([190.0, 220.0]).double(), torch.tensor([4500.0, 9000.0]).double()
    for name in ("des_mach", "des_cas_high_kt", "des_cas_low_kt"):
        assert getattr(back, name) == pytest.approx(getattr(after, name))
    # Numbers are written with all digits: no more than rounding apart.
    torch.testing.assert_close(back.drag_n(*state), after.drag_n(*state), rtol=1e-12, atol=0)
    torch.testing.assert_close(
        back.idle_thrust_n(state[1], state[0]), after.idle_thrust_n(state[1], state[0]), rtol=1e-12, atol=0
    )
    assert float(back.drag_n(*state)[0]) > 1.02 * float(mended.before.drag_n(*state)[0])
    air, theirs = importlib.import_module("pyBADA.atmosphere"), importlib.import_module("pyBADA.bada4")
    flown = theirs.Bada4Aircraft(badaVersion="4.3", acName=MODEL, filePath=str(folder))
    for tas, altitude in zip(*state, strict=True):
        theta, delta, _ = air.atmosphereProperties(h=float(altitude), deltaTemp=0.0)
        mach = float(tas_to_mach(tas, altitude))
        lift = flown.CL(delta, float(after.mass_reference_kg), mach)
        drag = flown.D(delta, mach, flown.CD(0, "LGUP", lift, mach))
        thrust = flown.Thrust(rating="LIDL", delta=delta, theta=theta, M=mach, deltaTemp=0.0)
        # As the classes agree elsewhere.
        assert drag == pytest.approx(float(after.drag_n(tas, altitude)), rel=1e-9)
        assert thrust == pytest.approx(float(after.idle_thrust_n(altitude, tas)), rel=1e-9)


def test_the_holders_file_is_changed_where_it_was_repaired_and_nowhere_else(mended: Repair, folder: Path) -> None:
    own, made = dummies() / MODEL / f"{MODEL}.xml", folder / MODEL / f"{MODEL}.xml"
    before, after = (list(etree.parse(file).getroot().iter()) for file in (own, made))
    changed = {one.getparent().tag: one.tag for one, other in zip(before, after, strict=True) if one.text != other.text}
    assert set(changed) == {"CD_clean", "CT", "SpeedPhase"}
    assert changed["CT"] == "ti"
    assert (folder / "GPF.xml").read_bytes() == (dummies() / "GPF.xml").read_bytes()
    shutil.copy(dummies() / "ACM_BADA4.xsd", folder)
    by = f"repaired by {mended.held_out.flights} flights of {mended.held_out.aircraft} aircraft"
    assert df.aircraft(MODEL, folder).source == f"{by}; {df.aircraft(MODEL, dummies()).source}" == mended.after.source
    page = (folder / "DUM2.html").read_text()
    assert "drag without lift (d1 to d5), factor" in page
    assert f"{MODEL}.xml" in page


def test_a_diagnosis_names_the_repair_of_the_model_itself(descents: Descents) -> None:
    report = df.diagnose(descents, typecode=MODEL, bada_dir=dummies())
    assert (
        repair_command(report) == f"descentflow repair FLIGHTS --aircraft {MODEL} --bada-dir DUMMY --out {MODEL}.html"
    )
    again = f"descentflow diagnose --real FLIGHTS --bada-dir DUMMY --typecode {MODEL} --simulator"
    assert next_command(report).startswith(again)


def test_what_cannot_be_written_is_refused(descents: Descents, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"ends in \.html"):
        df.repair(descents, aircraft=MODEL, bada_dir=dummies(), out=tmp_path / "DUM2.toml")
    with pytest.raises(ConfigError, match="written over"):
        df.repair(descents, aircraft=MODEL, bada_dir=dummies().parent, out=dummies() / "DUM2.html")
    with pytest.raises(AircraftError, match="idle thrust"):
        df.repair(descents, aircraft="Dummy-PST", bada_dir=dummies())
