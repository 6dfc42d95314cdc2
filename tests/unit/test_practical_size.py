"""A gap that is more than chance and does not matter: reported in aviation units, and no cause is looked for."""

from dataclasses import replace

import polars as pl
import pytest
import torch
from example_sides import example_sides

from descentflow.aircraft_types.registry import aircraft
from descentflow.core.mode_s_steps import STEPS
from descentflow.diagnosis.diagnosis_steps import diagnose_compared
from descentflow.diagnosis.gap._where import where
from descentflow.diagnosis.gap.costs import costs_of, profile_of
from descentflow.diagnosis.gap.practical_size import below_rounding, rounding_of
from descentflow.diagnosis.report.gap_report import GapReport
from descentflow.diagnosis.report.page import page
from descentflow.diagnosis.sides.diagnosis_settings import Settings
from descentflow.diagnosis.sides.simulator import Simulator
from descentflow.diagnosis.sides.two_sides import Compared
from descentflow.effects import EFFECTS

MANY = 1500


def diagnosed(sides: Compared) -> GapReport:
    asked = Settings(Simulator(aircraft("A320")), {"temperature": EFFECTS["temperature"]}, [], 0, str)
    return GapReport(**vars(diagnose_compared(sides, asked, "training flights", {}, pl.DataFrame())))


def small_gap(sides: Compared) -> list[str]:
    cells = where(sides, 290.0, 0)
    return [row.quantity for row in below_rounding(sides, cells, costs_of(sides, None, 0), profile_of(sides))]


def test_the_uncertainty_of_a_quantity_is_that_of_rounding_its_fields() -> None:
    """Reports rounded to the steps, against the formula: a true airspeed over that of its Mach number."""
    sides = example_sides()
    profile = profile_of(sides)
    found = rounding_of(sides, profile)[sides.columns("tas")]
    generator = torch.Generator().manual_seed(0)
    for at, here in ((0, profile[0]), (10, profile[10])):
        mach = float(sides.state.mach()[:, at].mean())
        tas = here.tas_kt + 40 * torch.rand(200_000, generator=generator, dtype=torch.float64) - 20
        ratio = mach + 0.1 * torch.rand(200_000, generator=generator, dtype=torch.float64) - 0.05
        told = [torch.round(v / STEPS[n]) * STEPS[n] for v, n in ((tas, "TAS"), (ratio, "Mach"))]
        error = (told[0] / tas).log() - (told[1] / ratio).log()
        # Speeds within 5 % of the middle: their mean uncertainty is that of the middle to 1 %.
        assert float(found[at]) == pytest.approx(float(error.std()), rel=0.01)


def test_a_fifth_of_a_kelvin_is_measurable_and_no_gap_to_explain() -> None:
    report = diagnosed(example_sides(EFFECTS["temperature"], [0.3], MANY))
    assert report.p_value < 0.02
    assert report.verdict == "none"
    assert report.causes == []
    assert {row.quantity for row in report.below_rounding} == {"rate", "cas", "tas"}
    said = "differ by less than the rounding of one flight's reports."
    assert said in str(report)
    assert "true airspeed against Mach number" in page(report)


def test_a_small_cost_of_time_that_is_more_than_chance_counts() -> None:
    """A rate that is 2 % slower throughout, and the time that it takes with it."""
    sides = example_sides(n=MANY)
    slower = torch.where(sides.real[:, None] & sides.of("rate"), -0.02, 0.0)
    assert small_gap(sides)
    assert small_gap(replace(sides, y=sides.y + slower)) == []


def test_flights_that_differ_more_are_a_gap_though_their_means_agree() -> None:
    sides = example_sides(n=MANY)
    wider = torch.where(sides.real[:, None] & sides.of("cas"), 1.5 * sides.y, sides.y)
    assert small_gap(replace(sides, y=wider)) == []


def test_few_flights_cannot_say_that_a_gap_is_small() -> None:
    assert small_gap(example_sides(EFFECTS["temperature"], [0.3], 80)) == []
