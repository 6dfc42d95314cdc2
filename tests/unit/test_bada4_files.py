"""Folders and files of BADA 4: what is recognised, and what each damage is refused with."""

import random
import shutil
from pathlib import Path

import pytest
from bada4_dummies import DUMMIES, dummies
from refusals import refuses

from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft
from descentflow.aircraft_types.nearest_type import nearest_type
from descentflow.aircraft_types.registry import aircraft, every_aircraft
from descentflow.core.errors import AircraftError, UnknownTypeError

MUTATIONS = 120


@pytest.fixture
def release(tmp_path: Path) -> Path:
    """A copy that a test may spoil, without schemas and tables, so that the reader's own checks are what answers."""
    left_out = shutil.ignore_patterns("*.xsd", "*.PTD")
    return Path(shutil.copytree(dummies(), tmp_path / "above" / "BADA_4.3", ignore=left_out))


def twin(release: Path) -> Path:
    return release / "Dummy-TWIN" / "Dummy-TWIN.xml"


def edit(file: Path, before: str, after: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert before in text
    file.write_text(text.replace(before, after, 1), encoding="utf-8")


def test_a_folder_and_one_above_it_are_recognised_and_named(release: Path) -> None:
    for folder in (release, release.parent):
        for name, code in zip(DUMMIES, ("DUM2", "DUM2", "DUMT", "DUMP"), strict=True):
            model = aircraft(name.lower(), folder)
            assert isinstance(model, Bada4Aircraft)
            assert model.typecode == code
            assert model.source == f"BADA 4.3 file {name}"
    assert aircraft("dumt", release).n_engines == 2
    assert every_aircraft(release).keys() == {"DUM2", "DUMT", "DUMP"}
    assert nearest_type("B738", release).typecode == "DUM2"


def test_a_list_of_types_names_the_model_of_each(release: Path) -> None:
    entries = "".join(
        f"<MAP><code>{code}</code><file>{name}</file></MAP>"
        for code, name in (("A320", "Dummy-TWIN-plus"), ("AT76", "Dummy-TBP"), ("B744", "not there"))
    )
    (release / "aircraft_model_default.xml").write_text(f"<AIRCRAFT>{entries}</AIRCRAFT>")
    model = aircraft("A320", release)
    assert (model.typecode, model.source) == ("A320", "BADA 4.3 file Dummy-TWIN-plus")
    assert every_aircraft(release).keys() == {"A320", "AT76"}


def test_a_folder_that_is_not_clear_is_refused_with_what_to_pass(release: Path) -> None:
    with pytest.raises(AircraftError, match=r"2 models of type DUM2 .*Dummy-TWIN, Dummy-TWIN-plus.*name the model"):
        aircraft("DUM2", release)
    refuses(UnknownTypeError, r"type 'DUMX' .*3 types or 4 models of BADA 4.*DUMT", aircraft, "DUMX", release)
    with pytest.raises(AircraftError, match=r"folder of one aircraft of BADA 4.*pass the folder above it"):
        aircraft("Dummy-TWIN", release / "Dummy-TWIN")
    shutil.copytree(release, release.parent / "BADA_4.2")
    with pytest.raises(AircraftError, match=r"2 folders of BADA 4: BADA_4\.2, BADA_4\.3.*pass one of them"):
        aircraft("Dummy-TWIN", release.parent)
    shutil.rmtree(release)
    release.mkdir()
    refuses(AircraftError, r"neither SYNONYM\.NEW nor OPF files, nor GPF\.xml", aircraft, "Dummy-TWIN", release)
    (release / "GPF.xml").touch()
    refuses(AircraftError, "no aircraft of BADA 4", aircraft, "Dummy-TWIN", release)


DAMAGES = {
    "cut": ("</bada40:ACM>", "", r"Premature end .*line 650"),
    "no number": ("<S>118.2</S>", "<S>x</S>", r"line 12: AFCM/S = 'x'; expected a finite number"),
    "not finite": ("<S>118.2</S>", "<S>inf</S>", r"line 12: AFCM/S = 'inf'"),
    "below zero": ("<S>118.2</S>", "<S>-1</S>", r"line 12: AFCM/S = -1; expected a number above zero"),
    "a part absent": ("<hmo>37000</hmo>", "", r"0 elements ALM/GLM/hmo; expected 1 of them"),
    "a number less": ("<ti>0.28031647589003378000</ti>", "", r"11 elements PFM/TFM/LIDL/CT/ti; expected 12"),
    "twice": ("<MTOW>65000</MTOW>", "<MTOW>65000</MTOW><MTOW>1</MTOW>", r"2 elements ALM/DLM/MTOW"),
    "masses": ("<OEW>40000</OEW>", "<OEW>70000</OEW>", r"an empty mass of 70000 kg; expected one below"),
    "engine": ("<type>JET</type>", "<type>RAM</type>", r"line 4: type 'RAM'; expected one of JET, TURBOPROP, PISTON"),
    "engine of another": ("<type>JET</type>", "<type>PISTON</type>", r"0 elements PFM/PEM/P"),
    "engines": ("<n_eng>2</n_eng>", "<n_eng>1.5</n_eng>", r"1.5 engines; expected a whole number"),
    "version": ("<p_theta>0.64707</p_theta>", "", r"0 elements PFM/p_theta"),
    "gear": ("<LG>DN</LG>", "<LG>IN</LG>", r"high-lift position '5' with gear 'IN'"),
    "position": ("<HLid>5</HLid>", "<HLid>9</HLid>", r"0 elements AFCM/Configuration\[@HLid='9'\]/LGDN"),
    "phase": ("<name>LD</name>", "<name>XX</name>", r"0 phases LD; expected one of them"),
    "no descent": ("<name>Descent</name>", "<name>Decent</name>", r"no speeds of the descent"),
    "namespace": ("standard_page/bada40", "standard_page/badah10", r"a root .*badah10.ACM; expected ACM of the"),
    "root": ("<bada40:ACM ", "<bada40:XYZ ", r"mismatch"),
    "document type": ("<bada40:ACM ", "<!DOCTYPE a [<!ENTITY b 'c'>]><bada40:ACM ", r"a document type"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_file_is_refused_with_file_line_and_mend(release: Path, damage: str) -> None:
    before, after, message = DAMAGES[damage]
    edit(twin(release), before, after)
    with pytest.raises(AircraftError, match=message) as caught:
        aircraft("Dummy-TWIN", release)
    assert "Dummy-TWIN.xml" in str(caught.value)
    assert "to mend it" in str(caught.value)
    assert aircraft("Dummy-TBP", release).engine == "turboprop"


OUT_OF_RANGE = {
    "heating value in MJ": ("<LHV>43217000</LHV>", "<LHV>43.217</LHV>", r"line 166: PFM/LHV: 43.22 J/kg; expected 4"),
    "scale of the drag": ("<scalar>1e-006<", "<scalar>1<", r"line 18: .*DPM_clean: .* of the weight as clean drag"),
    "an idle coefficient": ("<ti>0.28031647589003378000<", "<ti>280.31647589<", r"LIDL: .* of the weight as idle thr"),
    "wing area": (
        "<S>118.2</S>",
        "<S>1182</S>",
        r"line 12: AFCM/S: 54.99 kg of the heaviest mass on a m2; expected 120",
    ),
    "ceiling in metres": (
        "<hmo>37000</hmo>",
        "<hmo>11278</hmo>",
        r"line 513: ALM/GLM/hmo: .*expected 20,000 to 65,000",
    ),
    "mass in pounds": ("<OEW>40000</OEW>", "<OEW>4000</OEW>", r"ALM/DLM/OEW: 0.06154 of the heaviest mass empty"),
}


@pytest.mark.parametrize("damage", OUT_OF_RANGE)
def test_a_number_that_no_aircraft_has_is_refused_with_line_and_range(release: Path, damage: str) -> None:
    before, after, message = OUT_OF_RANGE[damage]
    edit(twin(release), before, after)
    refuses(AircraftError, message, aircraft, "Dummy-TWIN", release)


@pytest.mark.parametrize("name", DUMMIES)
def test_a_file_that_its_own_table_contradicts_is_refused(release: Path, name: str) -> None:
    """Numbers in range, but off by 3 %: the table beside the file tells, and nothing else can."""
    file = release / name / f"{name}.xml"
    area = file.read_text(encoding="utf-8").partition("<S>")[2].partition("</S>")[0]
    edit(file, f"<S>{area}</S>", f"<S>{1.03 * float(area)}</S>")
    assert aircraft(name, release).wing.area_m2 == pytest.approx(1.03 * float(area))
    shutil.copy(dummies() / name / f"{name}_ISA.PTD", file.parent)
    with pytest.raises(
        AircraftError, match=rf"{name}.xml: drag of .* where {name}_ISA.PTD, line \d+, has .*both files"
    ):
        aircraft(name, release)
    edit(file, f"<S>{1.03 * float(area)}</S>", f"<S>{area}</S>")
    assert aircraft(name, release) == aircraft(name, dummies())


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("<LHV>43217000</LHV>", "<LHV>46000000</LHV>", "fuel of .* in descent at FL"),
        ("<ti>0.28031647589003378000<", "<ti>0.29<", "thrust of .* in descent at FL"),
        ("<hmo>37000</hmo>", "<hmo>31000</hmo>", r"hmo = 31000 ft, and Dummy-TWIN_ISA.PTD has FL370"),
    ],
)
def test_a_table_tells_which_figure_is_off(release: Path, before: str, after: str, message: str) -> None:
    shutil.copy(dummies() / "Dummy-TWIN" / "Dummy-TWIN_ISA.PTD", twin(release).parent)
    edit(twin(release), before, after)
    refuses(AircraftError, message, aircraft, "Dummy-TWIN", release)


def test_a_release_s_own_schema_is_held_to(release: Path) -> None:
    shutil.copy(dummies() / "ACM_BADA4.xsd", release)
    assert aircraft("Dummy-TWIN", release) == aircraft("Dummy-TWIN", dummies())
    edit(twin(release), "<length>32.5</length>", "<length>long</length>")
    with pytest.raises(AircraftError, match=r"line \d+: Element 'length'.*expected what ACM_BADA4.xsd wants"):
        aircraft("Dummy-TWIN", release)
    (release / "ACM_BADA4.xsd").write_text("<a/>")
    refuses(AircraftError, r"ACM_BADA4.xsd: .*expected the schema", aircraft, "Dummy-TWIN", release)


def test_global_parameters_are_those_of_the_folder(release: Path) -> None:
    limits = aircraft("Dummy-TWIN", release).limits
    assert (limits.min_speed_factor, limits.approach_ceiling_ft, limits.landing_ceiling_ft) == (1.23, 8000.0, 3000.0)
    assert limits.des_increment_kt == (5.0, 10.0, 20.0, 50.0)
    edit(release / "GPF.xml", "<Phase>AP</Phase>", "<Phase>XX</Phase>")
    refuses(AircraftError, r"GPF.xml, line 2: no Hmax of AP", aircraft, "Dummy-TWIN", release)


def test_entities_and_addresses_are_not_followed(release: Path, tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("99")
    entity = f"<!DOCTYPE a [<!ENTITY s SYSTEM '{(tmp_path / 'secret').as_uri()}'>]>"
    edit(twin(release), "<bada40:ACM ", f"{entity}<bada40:ACM ")
    edit(twin(release), "<S>118.2</S>", "<S>&s;</S>")
    refuses(AircraftError, "a document type", aircraft, "Dummy-TWIN", release)
    many = "".join(f"<!ENTITY e{i} '{f'&e{i - 1};' * 10 if i else 'x' * 10}'>" for i in range(12))
    twin(release).write_text(f"<!DOCTYPE a [{many}]><a>&e11;</a>")
    with pytest.raises(AircraftError):
        aircraft("Dummy-TWIN", release)


def mutated(text: str, draw: random.Random) -> str:
    """One damage: a line out, twice, moved or cut, another number, a letter, or the end missing."""
    lines = text.splitlines()
    at, other = (draw.randrange(len(lines)) for _ in range(2))
    match draw.randrange(7):
        case 0:
            del lines[at]
        case 1:
            lines.insert(at, lines[other])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines[at] = lines[at][: draw.randrange(len(lines[at]) + 1)]
        case 4:
            value = draw.choice(["", "nan", "1e400", "-1e300", "0", "1e300", "1,5", "0x10", "1_0", "\u0661"])
            head, _, tail = lines[at].partition(">")
            lines[at] = f"{head}>{value}<{tail.partition('<')[2]}"
        case 5:
            place = draw.randrange(len(lines[at]) + 1)
            lines[at] = lines[at][:place] + chr(draw.randrange(1, 0x2FF)) + lines[at][place + 1 :]
        case _:
            return text[: draw.randrange(len(text))]
    return "\n".join(lines)


def test_a_mutated_file_is_read_or_refused(release: Path) -> None:
    draw, refused = random.Random(48), []
    files = [*release.glob("*/*.xml"), release / "GPF.xml"]
    whole = {file: file.read_text(encoding="utf-8") for file in files}
    for _ in range(MUTATIONS):
        file = draw.choice(files)
        file.write_text(mutated(whole[file], draw), encoding="utf-8")
        name = file.stem if file.stem in DUMMIES else "Dummy-TWIN"
        try:
            assert Bada4Aircraft.from_state(aircraft(name, release).to_state()).engine
        except AircraftError as error:
            refused.append(str(error))
        file.write_text(whole[file], encoding="utf-8")
    assert MUTATIONS / 4 < len(refused) < MUTATIONS
    assert all(str(release) in message for message in refused)
