"""Folders of BADA 4: ``GPF.xml``, and a folder with a file of the same name for each aircraft model."""

from difflib import get_close_matches
from pathlib import Path

from descentflow.aircraft_types.bada4.acm_file import read_acm, read_gpf, read_root, read_xml
from descentflow.aircraft_types.bada4.bada4_aircraft import Bada4Aircraft
from descentflow.core.errors import AircraftError, UnknownTypeError

GLOBAL_PARAMETERS = "GPF.xml"
SYNONYMS = "aircraft_model_default.xml"
"""Type designators and the model that stands for each, in releases that have the list."""


def release_folder(folder: str | Path) -> Path | None:
    """The folder of BADA 4 that this is, or that is the only one in it; None where there is none.

    Raises:
        AircraftError: If several are in it, or it is the folder of one aircraft.

    Example:
        >>> Path("releases/BADA_4.3").mkdir(parents=True)
        >>> _ = Path("releases/BADA_4.3/GPF.xml").write_text("...")
        >>> release_folder("releases").name
        'BADA_4.3'
    """
    folder = Path(folder)
    if (folder / GLOBAL_PARAMETERS).is_file():
        return folder
    inside = sorted(file.parent for file in folder.glob(f"*/{GLOBAL_PARAMETERS}"))
    if len(inside) > 1:
        raise AircraftError(
            f"{folder} holds {len(inside)} folders of BADA 4: {', '.join(name.name for name in inside)}",
            expected="one",
            mend="pass one of them",
        )
    if not inside and (folder / f"{folder.resolve().name}.xml").is_file():
        raise AircraftError(
            f"{folder} is the folder of one aircraft of BADA 4",
            expected=f"the folder with {GLOBAL_PARAMETERS}",
            mend="pass the folder above it",
        )
    return inside[0] if inside else None


def model_files(folder: Path) -> dict[str, Path]:
    """Files of the aircraft models of a folder by name."""
    models = {file.stem: file for file in sorted(folder.glob("*/*.xml")) if file.stem == file.parent.name}
    if not models:
        raise AircraftError(
            f"{folder} holds no aircraft of BADA 4",
            expected="a folder with an XML file of the same name for each aircraft model",
            mend="unpack the whole release there",
        )
    return models


def load_aircraft(typecode: str, folder: Path) -> Bada4Aircraft:
    """Load a type from a folder of BADA 4.

    Args:
        typecode: ICAO type designator, or the name of a model, in any case.
        folder: Of :func:`release_folder`.

    Returns:
        The aircraft, named by its designator.

    Raises:
        AircraftError: If a file is damaged, the type is not there, or several models have the designator.

    Example:
        >>> load_aircraft("A320", Path("no_such"))
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: no_such holds ...
    """
    file = file_of(typecode, folder)
    named = file.stem.upper() == typecode.strip().upper()
    return read_acm(file, read_gpf(folder / GLOBAL_PARAMETERS), None if named else typecode.strip().upper())


def file_of(typecode: str, folder: Path) -> Path:
    """File of a type or a model, see :func:`load_aircraft`."""
    wanted, models = typecode.strip().upper(), model_files(folder)
    named = {name.upper(): file for name, file in models.items()}
    if wanted in named:
        return named[wanted]
    known = _designators(folder, models)
    files = known.get(wanted, [])
    if not files:
        near = ", ".join(get_close_matches(wanted, [*known, *named], n=8)) or "none"
        raise UnknownTypeError(
            f"type {typecode!r} in {folder}",
            expected=f"one of the {len(known)} types or {len(named)} models of BADA 4 there (near it: {near})",
            mend="choose a type or a model that the folder holds",
        )
    if len(files) > 1:
        raise AircraftError(
            f"{len(files)} models of type {wanted} in {folder}: {', '.join(file.stem for file in files)}",
            expected="one model for a type",
            mend=f"name the model in place of the type, or one for each type in {SYNONYMS}",
        )
    return files[0]


def load_directory(folder: Path) -> dict[str, Bada4Aircraft]:
    """Load every type of a folder of BADA 4; of several models of a type, the first by name.

    Raises:
        AircraftError: As :func:`load_aircraft`, for the first file that fails.

    Example:
        >>> load_directory(Path("no_such"))
        Traceback (most recent call last):
        descentflow.core.errors.AircraftError: no_such holds ...
    """
    models, limits = model_files(folder), read_gpf(folder / GLOBAL_PARAMETERS)
    return {code: read_acm(files[0], limits, code) for code, files in _designators(folder, models).items()}


def _designators(folder: Path, models: dict[str, Path]) -> dict[str, list[Path]]:
    """Files by designator: of the release's list, which has one for each, and else of the files themselves."""
    listed = folder / SYNONYMS
    if listed.is_file():
        pairs = [(tag.text("code"), tag.text("file")) for tag in read_xml(listed, "the list of types").every(".//MAP")]
        return {code.upper(): [models[name]] for code, name in pairs if name in models}
    by_designator: dict[str, list[Path]] = {}
    for file in models.values():
        by_designator.setdefault(read_root(file, "ACM").text("ICAO/designator").upper(), []).append(file)
    return by_designator
