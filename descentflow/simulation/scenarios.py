"""Scenarios: settings of a world for each aircraft type, from a file that gives the reason for each."""

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import torch

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach
from descentflow.physics.performance_model import PerformanceModel
from descentflow.simulation.world_config import Operator, WorldConfig

PLAIN = "plain"
"""Name of the scenario that is :class:`WorldConfig` as it stands, for every type."""
BUILT_IN = {
    name: Path(__file__).with_name(f"{name.replace('-', '_')}.toml")
    for name in ("london-fir-2019", "gulf-summer", "nordic-winter")
}
"""Scenario -> its file: the paper's traffic, and two worlds that models are judged on and nothing was chosen on."""
_OWN = ("operators", "knee_fl", "tops_fl", "low_top_fl", "reason")
_FIELDS = {field.name for field in fields(WorldConfig)}


def scenario_settings(name: str, aircraft: PerformanceModel) -> WorldConfig:
    """Settings of a world for a type.

    Args:
        name: :data:`PLAIN`, one of :data:`BUILT_IN`, or the path of a TOML file of the same form.
        aircraft: Coefficients of the type: levels are given in units of its ceiling.

    Returns:
        The settings.

    Raises:
        ConfigError: If there is no such scenario, or it does not have the type, or holds what makes no world.

    Example:
        >>> from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
        >>> scenario_settings("london-fir-2019", open_aircraft("DH8D")).two_rates_share
        0.6
    """
    if name == PLAIN:
        return WorldConfig()
    tables = _read(name)
    types = sorted(tables.keys() - {"common"})
    if aircraft.typecode not in types:
        raise ConfigError(
            f"scenario {name} for {aircraft.typecode}",
            expected=f"one of its types: {', '.join(types)}",
            mend=f"use the scenario {PLAIN}, or add a table [{aircraft.typecode}] to a file of your own",
        )
    table = {**tables.get("common", {}), **tables[aircraft.typecode]}
    unknown = sorted(table.keys() - _FIELDS - set(_OWN))
    if unknown:
        raise ConfigError(
            f"scenario {name}, {aircraft.typecode}: {', '.join(unknown)}",
            expected=f"fields of WorldConfig, or {', '.join(_OWN)}",
            mend="correct the names",
        )
    try:
        return WorldConfig(**_settings(table, aircraft))
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(
            f"scenario {name}, {aircraft.typecode}: {error!r}",
            expected="operators of name, share, cas_kt and mach or knee_fl; ranges of two numbers",
            mend="correct the table",
        ) from error


def _read(name: str) -> dict[str, dict[str, Any]]:
    path = BUILT_IN.get(name, Path(name))
    try:
        return tomllib.loads(path.read_text())
    except OSError as error:
        raise ConfigError(
            f"no scenario {name}",
            expected=f"{PLAIN}, {', '.join(BUILT_IN)}, or a TOML file",
            mend="choose another name or path",
        ) from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{name} is not TOML: {error}", expected="a TOML file", mend="correct it") from error


def _settings(table: Mapping[str, Any], aircraft: PerformanceModel) -> dict[str, Any]:
    plain = {key: value for key, value in table.items() if key not in _OWN}
    settings = {key: tuple(map(float, v)) if isinstance(v, list) else v for key, v in plain.items()}
    ceiling_fl = float(aircraft.altitude_maximum_ft) / 100
    if "operators" in table:
        settings["operators"] = tuple(_operator(operator, table.get("knee_fl")) for operator in table["operators"])
    if "tops_fl" in table:
        low, high = table["tops_fl"]
        settings["top_range"] = (low / ceiling_fl, high / ceiling_fl)
    if "low_top_fl" in table:
        settings["low_top"] = table["low_top_fl"] / ceiling_fl
    return settings


def _operator(table: Mapping[str, Any], knee_fl: float | None) -> Operator:
    cas = float(table["cas_kt"])
    if "mach" in table or knee_fl is None:
        return Operator(table["name"], float(table["share"]), cas, float(table["mach"]))
    where = torch.tensor([cas * KT_MPS, knee_fl * FL_M], dtype=torch.float64)
    return Operator(table["name"], float(table["share"]), cas, float(cas_to_mach(where[0], where[1])))
