"""Against the table of pyBADA 0.1.14's values for its six dummy aircraft (three masses, three deviations, FL150 up)."""

import csv
import json
from collections import defaultdict

import pytest
import torch

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.core.units import KT_MPS
from descentflow.physics.atmosphere import density_kg_m3, pressure_pa, speed_of_sound_mps, temperature_k
from descentflow.physics.nominal_descent import nominal_state

TYPES = ("J2M", "J2H", "J4H", "BZJT", "TP2M", "GA")
RELATIVE = 1e-12
"""Both sides work in float64 with the same constants; measured: 4e-14."""
_PHASES = {"CR": "cr", "IC": "ic", "TO": "to", "AP": "ap", "LD": "ld"}


@pytest.fixture(scope="module")
def rows(shared):
    """Columns of the table by type, as float64 tensors."""
    path = shared / "aircraft" / "pybada_0.1.14_bada3_dummy_descent_allmass.csv"
    by_type = defaultdict(list)
    with path.open() as lines:
        for row in csv.DictReader(line for line in lines if not line.startswith("#")):
            by_type[row["ac"]].append(row)
    text = {"ac", "engine", "mass_label", "mode"}
    return {
        code: {
            name: torch.tensor([float(r[name]) for r in found], dtype=torch.float64) for name in found[0].keys() - text
        }
        for code, found in by_type.items()
    }


@pytest.fixture(scope="module")
def fleet(shared):
    """Aircraft built from the coefficients beside the table, not by this package's reader."""
    kept = json.loads((shared / "aircraft" / "bada3_dummy_coefficients.json").read_text())["aircraft"]
    return {code: _aircraft(code, kept[code]) for code in TYPES}, kept


def _aircraft(code, c):
    polars = {f"cd0_{low}": c["CD0"][up] for up, low in _PHASES.items()}
    polars |= {f"cd2_{low}": c["CD2"][up] for up, low in _PHASES.items()}
    polars |= {f"vstall_{low}_kt": c["Vstall"][up] for up, low in _PHASES.items()}
    return Bada3Aircraft(
        typecode=code,
        engine=c["engineType"].lower(),
        n_engines=2,
        wake_category="M",
        source="pyBADA dummy",
        mass_reference_kg=c["mass"]["reference"],
        mass_minimum_kg=c["mass"]["minimum"],
        mass_maximum_kg=c["mass"]["maximum"],
        mass_payload_kg=c["mass"]["max payload"],
        vmo_kt=c["VMO_kt"],
        mmo=c["MMO"],
        altitude_maximum_ft=c["hmo_ft"],
        altitude_mtow_ft=0.0,
        altitude_mass_gradient_ft_kg=c["mass"]["mass grad"],
        altitude_temperature_gradient_ft_k=0.0,
        wing_area_m2=c["S"],
        buffet_clbo=0.0,
        buffet_k=0.0,
        cd0_gear=c["CD0"]["GEAR_DOWN"],
        **polars,
        **{f"ct{i + 1}": value for i, value in enumerate(c["Ct"])},
        ct_des_low=c["CTdeslow"],
        ct_des_high=c["CTdeshigh"],
        altitude_des_ft=c["HpDes_ft"],
        ct_des_app=c["CTdesapp"],
        ct_des_ld=c["CTdesld"],
        cf1=c["Cf"][0],
        cf2=c["Cf"][1],
        cf3=c["CfDes"][0],
        cf4=c["CfDes"][1],
        cf_cr=c["CfCrz"],
        des_cas_low_kt=c["V1des_ms"] / KT_MPS,
        des_cas_high_kt=c["V2des_ms"] / KT_MPS,
        des_mach=c["Mdes"],
    )


def agree(found, expected):
    torch.testing.assert_close(found, expected, rtol=RELATIVE, atol=1e-12)


@pytest.mark.parametrize("code", TYPES)
def test_atmosphere(rows, code):
    r = rows[code]
    agree(temperature_k(r["h_m"], r["deltaTemp_K"]), r["T_K"])
    agree(pressure_pa(r["h_m"]), r["p_Pa"])
    agree(density_kg_m3(r["h_m"], r["deltaTemp_K"]), r["rho"])
    agree(speed_of_sound_mps(r["h_m"], r["deltaTemp_K"]), r["a_ms"])


@pytest.mark.parametrize("code", TYPES)
def test_speeds_forces_energy_share_rate_and_fuel(rows, fleet, code):
    r, aircraft = rows[code], fleet[0][code]
    assert len(r["h_m"]) == 225
    state = nominal_state(aircraft, r["h_m"], r["mass_kg"], r["deltaTemp_K"])
    columns = {
        "cas_mps": "CAS_ms",
        "mach": "Mach",
        "tas_mps": "TAS_ms",
        "esf": "ESF",
        "thrust_n": "Tidle_N",
        "drag_n": "Drag_N",
        "rate_mps": "ROCD_ms",
        "fuel_kg_s": "ff_kgs",
    }
    for name, column in columns.items():
        agree(getattr(state, name), r[column])
    agree(aircraft.climb_thrust_n(r["h_m"], state.tas_mps, r["deltaTemp_K"]), r["Tmaxclimb_N"])


@pytest.mark.parametrize("code", TYPES)
def test_transition_altitude(fleet, code):
    aircraft, kept = fleet
    assert aircraft[code].transition_altitude_m().item() == pytest.approx(kept[code]["crossover_m"], rel=RELATIVE)
