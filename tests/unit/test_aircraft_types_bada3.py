import shutil
from dataclasses import asdict, fields, replace
from pathlib import Path

import pytest
import torch
from bada4_dummies import dummies
from refusals import refuses

from descentflow.aircraft_types.bada3._bada_directory import load_aircraft, load_directory, read_gpf, to_aircraft
from descentflow.aircraft_types.bada3._fixed_columns import e10
from descentflow.aircraft_types.bada3.apf_file import read_apf, write_apf
from descentflow.aircraft_types.bada3.opf_file import read_opf, write_opf
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.aircraft_types.registry import aircraft, aircraft_from_state
from descentflow.aircraft_types.standard_descent import STANDARD
from descentflow.core.errors import AircraftError, DataError
from descentflow.physics.nominal_descent import nominal_descent

FILES = ("J2M___", "J2H___", "J4H___", "BZJT__", "TP2M__", "GA____")
LINES = {"mass": 18, "flaps": 31, "thrust": 44, "actype": 13}
"""Indices of some data lines of an OPF file."""


@pytest.fixture(scope="module")
def dummy() -> Path:
    """EUROCONTROL's dummy aircraft inside the installed pybada."""
    return dummies("BADA3")


@pytest.fixture
def release(dummy, tmp_path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(dummy, tmp_path / "bada"))


def edit(path: Path, index: int, change) -> None:
    lines = path.read_text(encoding="latin-1").splitlines()
    lines[index] = change(lines[index])
    path.write_text("\n".join(lines), encoding="latin-1")


@pytest.mark.parametrize("name", FILES)
def test_files_of_the_same_aircraft_stay_byte_for_byte(dummy, tmp_path, name):
    same = to_aircraft(read_opf(dummy / f"{name}.OPF"), read_apf(dummy / f"{name}.APF"))
    for suffix, write in (("OPF", write_opf), ("APF", write_apf)):
        write(same, tmp_path / f"{name}.{suffix}", dummy / f"{name}.{suffix}")
        assert (tmp_path / f"{name}.{suffix}").read_bytes() == (dummy / f"{name}.{suffix}").read_bytes()


@pytest.mark.parametrize("name", FILES)
def test_new_files_have_the_layout_of_eurocontrol_s(dummy, tmp_path, name):
    same = to_aircraft(read_opf(dummy / f"{name}.OPF"), read_apf(dummy / f"{name}.APF"))
    for suffix, write in (("OPF", write_opf), ("APF", write_apf)):
        write(same, tmp_path / f"{name}.{suffix}")
        new, theirs = ((folder / f"{name}.{suffix}").read_text("latin-1").split("\n") for folder in (tmp_path, dummy))
        kept = [not (line[:2] == "CD" or any(word in line for word in ("_date", "wake", "LO="))) for line in theirs]
        assert [line for line, is_kept in zip(new, kept, strict=True) if is_kept] == [
            line for line, is_kept in zip(theirs, kept, strict=True) if is_kept
        ]
        assert all(len(a) == len(b) and a[:2] == b[:2] for a, b in zip(new, theirs, strict=True))
    again = to_aircraft(read_opf(tmp_path / f"{name}.OPF"), read_apf(tmp_path / f"{name}.APF"))
    assert replace(again, source=same.source) == same


def test_a_repaired_file_changes_in_its_own_columns_alone(dummy, tmp_path):
    file = dummy / "J2M___.OPF"
    same = to_aircraft(read_opf(file), read_apf(dummy / "J2M___.APF"))
    write_opf(replace(same, typecode="A320", cd2_cr=0.0385), tmp_path / "A320__.OPF", file, "Mar 01 2024")
    before, now = (path.read_text("latin-1").split("\n") for path in (file, tmp_path / "A320__.OPF"))
    changed = [(a, b) for a, b in zip(before, now, strict=True) if a != b]
    assert all(len(a) == len(b) for a, b in changed)
    assert [b[:40].strip() for _, b in changed[1:4]] == [
        "CC      File_name: A320__.OPF",
        "CC      Modification_date: Mar 01 2024",
        "CD   A320__         2 engines    Jet",
    ]
    assert len(changed) == 5  # the title, these, and the clean polar


def test_apf_keeps_the_order_mach_high_low(dummy, tmp_path):
    speeds = read_apf(dummy / "TP2M__.APF").speeds
    assert [speeds[f"cruise_{name}"] for name in ("cas_low_kt", "cas_high_kt", "mach")] == [230.0, 220.0, 0.45]
    path = tmp_path / "A320__.APF"
    made = replace(open_aircraft("A320"), des_mach=0.78, des_cas_high_kt=300.0, des_cas_low_kt=250.0)
    write_apf(made, path)
    assert "78 300 250" in path.read_text()
    own = read_apf(path).speeds
    assert (own["des_mach"], own["des_cas_high_kt"], own["des_cas_low_kt"]) == (
        0.78,
        300.0,
        250.0,
    )


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e120])
def test_numbers_that_do_not_fit_are_refused(value):
    refuses(AircraftError, "finite number", e10, value)


def test_types_resolve_through_synonyms(dummy):
    model = load_aircraft("b738", dummy)
    assert model.typecode == "B738"
    assert "J2M" in model.source
    assert model.wing_area_m2 == load_aircraft("J2M", dummy).wing_area_m2
    assert aircraft("B738", dummy) == model
    assert aircraft("A320").source == open_aircraft("A320").source


def test_a_whole_directory_loads(dummy):
    everything = load_directory(dummy)
    assert len(everything) == 136
    assert {a.engine for a in everything.values()} == {"jet", "turboprop", "piston"}


def test_flap_names_may_hold_blanks(release):
    edit(release / "J2M___.OPF", LINES["flaps"], lambda x: x[:10] + "1 + F 20  " + x[20:])
    assert read_opf(release / "J2M___.OPF").numbers["cd0_ap"] == 0.0477


def test_without_synonyms_files_stand_for_themselves(release):
    (release / "SYNONYM.NEW").unlink()
    assert load_aircraft("GA", release).engine == "piston"
    refuses(AircraftError, "A320", load_aircraft, "A320", release)


def test_line_ends_of_other_systems_are_read(release):
    path = release / "J2M___.OPF"
    before = read_opf(path)
    path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    assert read_opf(path) == before


def test_gpf_of_the_release_is_the_manual_s(dummy):
    assert read_gpf(dummy / "BADA.GPF") == STANDARD


def test_gpf_changes_reach_the_parameters_and_newer_engine_names_are_known(release):
    path = release / "BADA.GPF"
    text = path.read_text().replace(
        "C_v_min         mil,civ jet,turbo,piston", "C_v_min         mil,civ jet,tbp,pst     "
    )
    path.write_text(text.replace(".13000E+01", ".14000E+01").replace("jet,turbo ", "jet,tbp   "))
    assert read_gpf(path).min_speed_factor == 1.4


SPOILS = {
    "letters in a number": ("J2M___.OPF", LINES["mass"], lambda x: x.replace(".58000E+02", ".58O00E+02"), "line 19"),
    "a line slipped to the left": ("J2M___.OPF", LINES["thrust"], lambda x: x[:4] + x[5:-1] + " /", "line 45"),
    "an infinite number": ("J2M___.OPF", LINES["mass"], lambda x: x.replace(".58000E+02", "       inf"), "line 19"),
    "an unknown engine": ("J2M___.OPF", LINES["actype"], lambda x: x.replace("Jet", "Ion"), "line 14"),
    "no wake category": ("J2M___.OPF", LINES["actype"], lambda x: x[:59] + " " + x[60:], "line 14"),
    "no type": ("J2M___.OPF", LINES["actype"], lambda x: x[:5] + "______" + x[11:], "line 14"),
    "a phase out of order": ("J2M___.OPF", LINES["flaps"], lambda x: x.replace("AP", "XX"), "line 32"),
    "a lost line": ("J2M___.OPF", LINES["mass"], lambda x: "CC" + x[2:], "line 59: 21 data lines"),
    "an APF number": ("J2M___.APF", 22, lambda x: x.replace("74  74", "74  7x"), "line 23"),
    "a superscript in an APF speed": ("J2M___.APF", 20, lambda x: x.replace("280", "²80"), "line 21"),
    "an APF range": ("J2M___.APF", 21, lambda x: x.replace("AV", "MI"), "line 22"),
    "an APF without default": ("J2M___.APF", 19, lambda x: x.replace("***", "BAW"), "line 20"),
    "a lost APF line": ("J2M___.APF", 22, lambda x: "CC" + x[2:], "line 22: 3 data lines"),
    "a synonym twice": ("SYNONYM.NEW", 18, lambda x: x.replace("A30B", "A306"), "line 19"),
    "a slipped synonym": ("SYNONYM.NEW", 17, lambda x: x[:5] + " " + x[5:], "line 18"),
}


@pytest.mark.parametrize("spoil", SPOILS)
def test_malformed_lines_are_named_by_file_and_line(release, spoil):
    file, index, change, place = SPOILS[spoil]
    edit(release / file, index, change)
    refuses(AircraftError, rf"{file} {place}", load_aircraft, "A320", release)


def test_a_gpf_without_a_parameter_is_refused(release):
    path = release / "BADA.GPF"
    path.write_text(path.read_text().replace("H_max_app", "H_max_xxx"))
    refuses(AircraftError, "no parameter H_max_app", read_gpf, path)


def test_global_parameters_of_the_directory_hold(release):
    path = release / "BADA.GPF"
    manual = load_aircraft("A320", release)
    assert manual.limits == STANDARD
    whole = path.read_text()
    path.write_text(whole.replace(".13000E+01", ".14000E+01"))
    faster = load_aircraft("A320", release)
    assert (faster.minimum_cas_mps(1e3) / manual.minimum_cas_mps(1e3)).item() == pytest.approx(1.4 / 1.3)
    assert aircraft_from_state(faster.to_state()) == faster
    for spoilt in ("two", ""):
        path.write_text(whole.replace(".20000E+01", spoilt))
        refuses(AircraftError, r"BADA.GPF line 25", load_aircraft, "A320", release)
    path.unlink()
    assert load_aircraft("A320", release) == manual


def test_global_parameters_of_a_checkpoint_that_are_none_are_refused(release):
    state = load_aircraft("A320", release).to_state()
    for wrong in ({"min_speed_factor": 1.3}, "all", 7, {**asdict(STANDARD), "des_increment_kt": (1.0, "x", 2.0, 3.0)}):
        refuses(AircraftError, "coefficient", aircraft_from_state, {**state, "limits": wrong})


def test_empty_foreign_and_absent_files_are_refused(release, tmp_path):
    (release / "J2M___.OPF").write_text("")
    refuses(AircraftError, "no data line", load_aircraft, "A320", release)
    (release / "J2M___.OPF").write_bytes(bytes(range(256)))
    refuses(AircraftError, "no data line", load_aircraft, "A320", release)
    (release / "J2M___.OPF").unlink()
    refuses(AircraftError, "No such file", load_aircraft, "A320", release)
    refuses(AircraftError, "an existing folder of BADA 3", load_aircraft, "A320", tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    refuses(AircraftError, "neither SYNONYM", load_aircraft, "A320", tmp_path / "empty")


def test_an_unknown_type_is_refused_with_near_names(dummy):
    refuses(AircraftError, "A320", load_aircraft, "A32O", dummy)


def test_files_of_two_types_are_not_joined(dummy):
    with pytest.raises(AircraftError, match="OPF of J2M with APF of GA"):
        to_aircraft(read_opf(dummy / "J2M___.OPF"), read_apf(dummy / "GA____.APF"))


def test_an_apf_refuses_to_round_speeds(tmp_path):
    with pytest.raises(AircraftError, match="des_mach"):
        write_apf(replace(open_aircraft("A320"), des_mach=0.785), tmp_path / "A320__.APF")
    with pytest.raises(AircraftError, match="des_cas_high_kt"):
        write_apf(replace(open_aircraft("A320"), des_cas_high_kt=287.5), tmp_path / "A320__.APF")
    assert not list(tmp_path.iterdir())


def test_an_opf_refuses_what_does_not_fit_and_leaves_nothing_behind(tmp_path):
    ours = open_aircraft("A320")
    for spoiled in (replace(ours, typecode="TOOLONG"), replace(ours, ct1=float("nan"))):
        with pytest.raises(AircraftError):
            write_opf(spoiled, tmp_path / "x.OPF")
    assert not list(tmp_path.iterdir())
    refuses(DataError, "folder", write_opf, ours, tmp_path / "absent" / "x.OPF")


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    """A BADA directory of the open aircraft, written by the package; no SYNONYM.NEW."""
    folder = tmp_path_factory.mktemp("bada")
    for code in open_typecodes():
        write_opf(open_aircraft(code), folder / f"{code:_<6}.OPF")
        write_apf(open_aircraft(code), folder / f"{code:_<6}.APF")
    return folder


@pytest.mark.parametrize("code", open_typecodes())
def test_every_open_aircraft_flies_alike_from_a_directory_that_the_package_wrote(written, code):
    ours, read = open_aircraft(code), aircraft(code, written)
    for field in fields(ours):
        old, new = getattr(ours, field.name), getattr(read, field.name)
        if field.name != "source":
            # Five printed digits, four of a negative number.
            assert new == (pytest.approx(old, rel=5e-4 if old < 0 else 5e-5) if isinstance(old, int | float) else old)
    levels = torch.arange(0, int(ours.altitude_maximum_ft / 100), 10)
    first, other = (nominal_descent(a, levels) for a in (ours, read))
    # Coefficients rounded to 5e-5 of themselves, some of them amplified where thrust is near drag.
    torch.testing.assert_close(other.time_s, first.time_s, rtol=5e-4, atol=0.01)
