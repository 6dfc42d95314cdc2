"""The type whose coefficients stand for another's: by figures of OpenAP, and none that nobody can check."""

from pathlib import Path

import pytest

from descentflow.aircraft_types.nearest_type import LARGEST_RATIO, nearest_type, type_sizes
from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft, open_typecodes
from descentflow.core.errors import AircraftError


@pytest.mark.parametrize("typecode", sorted(type_sizes()))
def test_the_nearest_is_nearest(typecode: str) -> None:
    """Against a search of all open aircraft with as many engines of the kind."""
    size = type_sizes()[typecode]
    every = [open_aircraft(name) for name in open_typecodes()]
    ratio = {other.typecode: float(other.mass_maximum_kg) / size.mass_maximum_kg for other in every}
    apart = {name: max(r, 1 / r) for name, r in ratio.items()}
    near = [other for other in every if other.engine == size.engine and apart[other.typecode] <= LARGEST_RATIO]
    able = [other for other in near if other.n_engines == size.n_engines] or near
    if not able:
        with pytest.raises(AircraftError, match="no coefficients near"):
            nearest_type(typecode)
        return
    assert apart[nearest_type(typecode).typecode] == min(apart[other.typecode] for other in able)


def test_a_type_of_unknown_size_is_refused() -> None:
    with pytest.raises(AircraftError, match="size of type 'ZZZZ' is not known"):
        nearest_type("ZZZZ")


def test_sizes_are_those_of_openap() -> None:
    openap = pytest.importorskip("openap", reason="comes with the extra bluesky")
    yaml = pytest.importorskip("yaml")
    for typecode, size in type_sizes().items():
        path = Path(openap.__file__).parent / "data" / "aircraft" / f"{typecode.lower()}.yml"
        settings = yaml.safe_load(path.read_text())
        assert settings["engine"]["type"] == "turbofan"
        assert (size.engine, size.n_engines) == ("jet", settings["engine"]["number"])
        assert size.mass_maximum_kg == settings["mtow"]
