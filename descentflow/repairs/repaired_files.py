"""Files of a repaired type: our TOML with intervals, files of BADA, OpenAP's polar, bluebird-dt's tables."""

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from descentflow.aircraft_types.bada3.apf_file import write_apf
from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.aircraft_types.bada3.opf_file import write_opf
from descentflow.aircraft_types.bada4.acm_file import changed_acm
from descentflow.aircraft_types.bada4.bada4_directory import GLOBAL_PARAMETERS
from descentflow.aircraft_types.open_types.open_aircraft import open_type
from descentflow.core.errors import ConfigError
from descentflow.core.files import check_output, write_whole
from descentflow.exports.bluebird_tables import KINDS, tables
from descentflow.repairs._nominal_fleet import nominal_fleet
from descentflow.repairs._repair_page import page
from descentflow.repairs.repair_found import FACTORS, SPEEDS, CoefficientEstimate, Repair


def paths_of(out: Path, typecode: str, own: Path | None = None) -> dict[str, Path]:
    """All files that are written, by kind.

    Args:
        out: Output.
        typecode: Type designator.
        own: The licence holder's file.

    Example:
        >>> [path.name for path in paths_of(Path("A320.toml"), "A320").values()][:4]
        ['A320.toml', 'A320__.OPF', 'A320__.APF', 'A320_openap.yml']
        >>> list(paths_of(Path("A320.html"), "A320", Path("A320-231/A320-231.xml")))[:2]
        ['acm', 'gpf']
    """
    if own is not None and own.suffix == ".xml":
        files = {"acm": out.parent / own.stem / own.name, "gpf": out.with_name(GLOBAL_PARAMETERS)}
    else:
        files = {"toml": out, "opf": out.with_name(f"{typecode:_<6}.OPF"), "apf": out.with_name(f"{typecode:_<6}.APF")}
        files["openap"] = out.with_name(f"{out.stem}_openap.yml")
    tabled = {kind: out.with_name(f"{out.stem}_bluebird_{kind}.json") for kind in KINDS}
    return files | tabled | {"page": out.with_name(f"{out.stem}.html")}


def check_out(out: Path, typecode: str, own: Path | None) -> None:
    """Refuse an output that cannot be written, or would write over the files that are repaired.

    Raises:
        ConfigError: If its name does not end in .toml (.html for BADA 4), or it lies in the folder of the files.
        DataError: If the folder does not exist.
    """
    paths = paths_of(out, typecode, own)
    ending = ".toml" if "toml" in paths else ".html"
    if out.suffix != ending:
        raise ConfigError(f"output {out}", expected=f"a name that ends in {ending}", mend=f"name it {typecode}{ending}")
    if own is not None and own.resolve().parent in {path.resolve().parent for path in paths.values()}:
        raise ConfigError(
            f"output in {out.parent}, whose files would be written over", expected="another folder", mend="choose one"
        )
    for kind, path in paths.items():
        check_output(path if kind != "acm" else out)


def write_repair(repair: Repair, out: Path) -> list[Path]:
    """Write all files, each whole or not at all.

    Args:
        repair: The repair.
        out: Name of the TOML file; the others lie next to it, the OPF and APF by their usual names, so that the folder
            is a ``bada_dir``.

    Returns:
        The files.
    """
    code = repair.after.typecode
    paths = paths_of(out, code, repair.own)
    profile, uncertainty = tables(nominal_fleet(repair))
    made = {"profile": {"aircraft": {code: profile}}, "uncertainty": {"aircraft": {code: uncertainty}}}
    texts = {kind: json.dumps({**made, "mapping": {code: code, "DEFAULT": code}}[kind], indent=1) for kind in KINDS}
    texts["page"] = page(repair, paths)
    if isinstance(repair.after, Bada3Aircraft):
        texts |= {"toml": toml_text(repair, repair.after), "openap": openap_text(repair.after)}
        for kind, write in (("opf", write_opf), ("apf", write_apf)):
            write(repair.after, paths[kind], repair.own and repair.own.with_suffix(f".{kind.upper()}"), repair.last_day)
    elif repair.own is not None:
        _write_bada4(repair, repair.own, paths)
    for kind, text in texts.items():
        write_whole(paths[kind], text)
    return list(paths.values())


def _write_bada4(repair: Repair, acm: Path, paths: Mapping[str, Path]) -> None:
    """The user's own XML file with the repaired numbers alone changed, and GPF.xml as it is."""
    numbers = {estimate.name: estimate.after for estimate in repair.estimates if repair.changed}
    factors = {name: numbers.get(name, 1.0) for name in FACTORS}
    speeds = {name: numbers[name] for name in SPEEDS if name in numbers}
    paths["acm"].parent.mkdir(exist_ok=True)
    note = repair.after.source.removesuffix(f"; {repair.before.source}") if repair.changed else ""
    made = {
        "acm": changed_acm(acm, speeds, note, **factors),
        "gpf": (acm.parent.parent / GLOBAL_PARAMETERS).read_bytes(),
    }
    for kind, content in made.items():
        write_whole(paths[kind], content)


def toml_text(repair: Repair, after: Bada3Aircraft) -> str:
    """The type in the form of the open types, repaired numbers with a 90 % interval.

    Example:
        >>> from descentflow.repairs.repair import repair
        >>> import tomllib
        >>> repaired = repair("descents.parquet", aircraft="A320")
        >>> tomllib.loads(toml_text(repaired, repaired.after))["coefficients"]["cd0_cr"]["unit"]
        '1'
    """
    judged = repair.held_out
    units = {coefficient.name: coefficient.unit for coefficient in open_type("A320").coefficients}
    repaired = {estimate.name: estimate for estimate in repair.estimates} if repair.changed else {}
    flights = f"{judged.flights} flights of {judged.aircraft} aircraft"
    lines = [
        f"# {after.typecode}, {_title(repair)}; the numbers hold at the reference mass.",
        f"summary = {json.dumps(after.source)}",
        f"known_to_be_off = {json.dumps(repair.what_stays)}",
        "",
        "[coefficients]",
    ]
    for row in fields(Bada3Aircraft):
        if row.name in units:
            value: Any = getattr(after, row.name)
            entry = {"value": value, "unit": units[row.name], "source": repair.before.source, "confidence": "unchecked"}
            if row.name in repaired:
                entry |= _entry(repaired[row.name], flights)
            lines.append(f"{row.name} = {{ {', '.join(f'{k} = {json.dumps(v)}' for k, v in entry.items())} }}")
    return "\n".join(lines) + "\n"


def _title(repair: Repair) -> str:
    return "repaired by descentflow" if repair.changed else "as it was, for other aircraft are predicted no better"


def _entry(one: CoefficientEstimate, flights: str) -> dict[str, Any]:
    ends = [float(f"{end:.4g}") for end in (one.low, one.high)]
    return {"source": f"{one.source}: {flights}", "confidence": "fitted", "interval": ends}


def openap_text(after: Bada3Aircraft) -> str:
    """The clean polar as OpenAP has it, which BlueSky reads: for the file of the type in its ``data/dragpolar``.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> print(openap_text(aircraft("A320")))
        # A320, on 122.4 m2: these two numbers of `clean` in data/dragpolar/a320.yml of OpenAP; its others stay
        clean:
          cd0: 0.01751
          k: 0.04269
        <BLANKLINE>
    """
    code, area = after.typecode, float(after.wing_area_m2)
    return (
        f"# {code}, on {area:g} m2: these two numbers of `clean` in data/dragpolar/{code.lower()}.yml of OpenAP; "
        "its others stay\n"
        f"clean:\n  cd0: {float(after.cd0_cr):.5g}\n  k: {float(after.cd2_cr):.5g}\n"
    )
