"""Place of a gap against other implementations and chance, and flights that are worth a look."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import polars as pl
import pytest
import torch
from example_sides import example_sides
from scipy.stats import binom, ttest_ind
from torch import Tensor

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.diagnosis.findings.costs_found import LevelMeans
from descentflow.diagnosis.gap._labellings import AT_ONCE, labellings, labellings_of, noise_floor, step_down
from descentflow.diagnosis.gap._what_is_left import flights_worth_a_look
from descentflow.diagnosis.gap._where import cell_scores, cells, squared_t, where
from descentflow.diagnosis.sides.assumptions import ASSUMED
from descentflow.diagnosis.sides.two_sides import Compared, compare
from descentflow.measurements.quantities import CHANNELS, Quantities, quantities_of

TRANSITION_FL = 318.0


@dataclass(frozen=True)
class FlightLaw:
    """Covariance roots of what aircraft have in common and of what flights add, with the flights it was learnt from."""

    measured: Compared
    of_aircraft: Tensor
    of_flights: Tensor

    @classmethod
    def of(cls, measured: Compared) -> "FlightLaw":
        """Moments of pairs of flights of one aircraft, and of flights."""
        y = measured.y - measured.y.nanmean(0)
        z, seen = y.nan_to_num(0.0), y.isfinite().double()
        whole = (z.T @ z) / (seen.T @ seen).clamp(min=1)
        _, index = torch.unique(measured.airframe, return_inverse=True)
        count = int(index.max()) + 1
        total = torch.zeros(count, y.shape[1], dtype=y.dtype).index_add_(0, index, z)
        there = torch.zeros(count, y.shape[1], dtype=y.dtype).index_add_(0, index, seen)
        pairs = (there.T @ there - seen.T @ seen).clamp(min=1)
        shared = (total.T @ total - z.T @ z) / pairs
        scale = whole.diagonal().sqrt()
        unit = scale[:, None] * scale
        return cls(measured, scale[:, None] * _root(shared / unit), scale[:, None] * _root((whole - shared) / unit))

    def draw(self, simulated: Sequence[int], real: Sequence[int], seed: int, speeds: int | None = None) -> Compared:
        """Flights of aircraft with so many flights each, on both sides of one population.

        What a flight does not show is as in a measured flight, whose speeds it also has; those are drawn by the seed
        ``speeds``, if given.
        """
        sizes = torch.tensor([*simulated, *real])
        airframe = torch.arange(len(sizes)).repeat_interleave(sizes)
        n, p = len(airframe), self.measured.y.shape[1]
        chosen = torch.Generator().manual_seed(seed if speeds is None else speeds)
        like = torch.randint(len(self.measured.y), (n,), generator=chosen)
        generator = torch.Generator().manual_seed(seed + 10**6)
        common = torch.randn(len(sizes), p, generator=generator, dtype=torch.float64) @ self.of_aircraft.T
        own = torch.randn(n, p, generator=generator, dtype=torch.float64) @ self.of_flights.T
        y = torch.where(self.measured.y[like].isfinite(), common[airframe] + own, torch.nan)
        is_real = torch.arange(n) >= sum(simulated)
        return replace(self.measured, y=y, real=is_real, airframe=airframe, state=self.measured.state.rows(like))


def _root(matrix: Tensor) -> Tensor:
    """Root of the nearest positive semidefinite matrix."""
    values, vectors = torch.linalg.eigh((matrix + matrix.T) / 2)
    return vectors * values.clamp(min=0.0).sqrt()


@pytest.fixture(scope="module")
def compared(halves: tuple[Quantities, Quantities]) -> Compared:
    return compare(*halves, open_aircraft("A320"))


def drawn(n: int, p: int, seed: int) -> torch.Tensor:
    return torch.randn(n, p, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_with_one_flight_an_aircraft_the_statistic_is_welchs() -> None:
    y, real = drawn(60, 3, seed=0), torch.arange(60) >= 20
    y[real] = 2.0 * y[real] + 0.4
    y[5:15, 1] = torch.nan
    squared = squared_t(y, labellings(torch.arange(60), real, 0, seed=0))[0]
    squares = (y - y.nanmean(0)) ** 2
    of_both = [
        ttest_ind(v[real], v[~real], equal_var=False, nan_policy="omit").statistic ** 2
        for v in (y.numpy(), squares.numpy())
    ]
    torch.testing.assert_close(squared, torch.tensor(of_both[0] + of_both[1]), rtol=1e-9, atol=0)


def test_whole_aircraft_make_the_variance() -> None:
    """Every flight copied four times over adds nothing."""
    y, real = drawn(60, 2, seed=1), torch.arange(60) >= 30
    once = squared_t(y, labellings(torch.arange(60), real, 5, seed=0))
    five = [value.repeat_interleave(5, 0) for value in (y, torch.arange(60), real)]
    again = squared_t(five[0], labellings(five[1], five[2], 5, seed=0))
    torch.testing.assert_close(again, once, rtol=1e-9, atol=0)


def test_sums_of_many_labellings_are_those_of_each() -> None:
    airframe, real, values = torch.arange(40) // 2, torch.arange(40) >= 16, drawn(40, 3, seed=2)
    dealt = labellings(airframe, real, AT_ONCE + 20, seed=4)
    each = torch.stack([values[side].sum(0) for side in dealt])
    torch.testing.assert_close(dealt.sums(dealt.by_aircraft(values)), each)
    assert torch.equal(dealt.flights(0), real)
    assert bool((dealt.sides.sum(1) == 12).all())


def test_step_down_is_westfall_and_youngs_algorithm() -> None:
    scores = drawn(200, 6, seed=5)
    scores[0] += torch.tensor([4.0, 0.0, 2.0, 1.0, 2.5, -1.0])
    order = sorted(range(6), key=lambda i: -float(scores[0, i]))
    expected, so_far = [0.0] * 6, 0.0
    for rank, i in enumerate(order):
        count = sum(float(max(row[j] for j in order[rank:])) >= float(scores[0, i]) for row in scores)
        so_far = max(so_far, count / 200)
        expected[i] = so_far
    assert step_down(scores).tolist() == pytest.approx(expected)


def test_cells_are_called_by_chance_as_often_as_is_said(compared: Compared) -> None:
    """Aircraft of unequal numbers of flights; at 5 %, more than 11 of 100 nulls come once in 230 times."""
    law = FlightLaw.of(compared)
    known = cells(compared, TRANSITION_FL)
    called = 0
    for seed in range(100):
        null = law.draw([1] * 40 + [3] * 20, [1] * 40 + [3] * 20, seed)
        scores = cell_scores(null.y, labellings_of(null, 199, seed), known)
        called += float(step_down(scores).min()) <= ASSUMED.false_cells
    assert called <= binom.isf(0.005, 100, ASSUMED.false_cells)


def test_a_gap_in_two_cells_is_found_and_not_diluted(compared: Compared) -> None:
    """Level-offs of 51 s a flight, in six flights of ten: the shares are the means in spreads between flights."""
    taken = (torch.rand(len(compared.y), generator=torch.Generator().manual_seed(0)) < 0.6) & compared.real
    y = compared.y.clone()
    level, gaps = compared.columns("level"), compared.columns("level_gaps")
    y[:, level] += 85.0 * taken[:, None]
    y[:, gaps] += 1.0 * taken[:, None]
    seconds, number = y[:, level], y[:, gaps]
    late = replace(compared, y=y, scale=_spreads(y, compared))
    found = where(late, TRANSITION_FL, seed=0)
    assert {row.quantity for row in found if row.share > 0} == {"level", "level_gaps"}
    rows = {row.quantity: row for row in found[:2]}
    assert rows["level"].difference == pytest.approx(51.0, abs=12.0)
    assert rows["level"].p_value == pytest.approx(1 / 2000)
    apart = {
        name: float((v[late.real].mean() - v[~late.real].mean()) / late.scale[at])
        for name, v, at in (("level", seconds, level), ("level_gaps", number, gaps))
    }
    # The floors, a tenth of the distances, are not alike in both.
    for name, value in apart.items():
        assert rows[name].share == pytest.approx(value / sum(apart.values()), abs=0.02)
    assert sum(row.share for row in found) == pytest.approx(1.0)


def _spreads(y: torch.Tensor, compared: Compared) -> torch.Tensor:
    """As :func:`compare` pools them: of flights about their side's mean."""
    centred = torch.cat([y[side] - y[side].nanmean(0) for side in (~compared.real, compared.real)])
    seen = centred.isfinite().sum(0)
    return (centred.nan_to_num(0.0).square().sum(0) / (seen - 2).clamp(min=1)).sqrt().clamp(min=1e-9)


def test_a_gap_does_not_blur_its_own_floor(compared: Compared) -> None:
    dealt = [labellings_of(compared, 10, seed=0).flights(k) for k in range(1, 11)]
    counts = torch.zeros(len(compared.entries), dtype=torch.bool)
    apart = compared.y + 5.0 * compared.scale * compared.real[:, None]
    floors = [noise_floor(y, compared.real, dealt, compared.scale, counts) for y in (compared.y, apart)]
    torch.testing.assert_close(floors[0], floors[1], rtol=1e-9, atol=1e-12)


def test_what_too_few_simulated_flights_show_is_left_out_and_not_taken_for_standard_air(
    halves: tuple[Quantities, Quantities],
) -> None:
    """Nine flights show a TAS: they are no claim that air is standard, which only a simulator without any TAS makes."""
    reference, real = halves
    few = torch.arange(len(reference)) < 9
    tas = torch.where(few[:, None], reference.values["tas"], torch.nan)
    blank = torch.full_like(tas, torch.nan)
    sides = {
        name: compare(replace(reference, values={**reference.values, "tas": values}), real, open_aircraft("A320"))
        for name, values in (("few", tas), ("none", blank))
    }
    assert "tas" not in sides["few"].quantities()
    assert "tas" in sides["none"].quantities()


HAVING = range(1, 80, 4)
"""Real flights (of 80) that have something no effect names."""


def some() -> Compared:
    """Twenty of eighty flights come down a quarter faster in three bands."""
    sides = example_sides()
    y = sides.y.clone()
    at = [i for i, e in enumerate(sides.entries) if e.quantity == "rate" and e.band in (4, 5, 6)]
    for flight in HAVING:
        y[80 + flight, at] += 0.25
    return replace(sides, y=y, names=tuple(f"flight-{i}" for i in range(80)))


def test_flights_that_have_what_is_left_come_first() -> None:
    sides = some()
    profile = [LevelMeans(160.0 + 20 * k, 2000.0, 280.0, 380.0) for k in range(11)]
    worth_a_look = flights_worth_a_look(sides, sides.y, profile)
    assert len(worth_a_look) == 10
    assert {flight.flight for flight in worth_a_look} <= {f"flight-{i}" for i in HAVING}
    # In the three bands, give or take one by chance, and of the size that was given.
    assert worth_a_look[0].quantity == "rate"
    assert worth_a_look[0].low_fl >= 210.0
    assert worth_a_look[0].high_fl <= 310.0
    assert all(flight.unit == "ft/min" for flight in worth_a_look)
    mean = sum(flight.excess for flight in worth_a_look) / len(worth_a_look)
    assert mean == pytest.approx(2000 * 0.284, rel=0.2)


def test_without_identifiers_none_is_named() -> None:
    sides = some()
    assert flights_worth_a_look(replace(sides, names=()), sides.y, []) == []


def test_identifiers_stay_with_their_flights() -> None:
    frame = pl.DataFrame(
        {
            "flight_id": [f"f{i}" for i in range(3) for _ in range(40)],
            "icao24": "4b1800",
            "level_fl": [150 + k for _ in range(3) for k in range(40)],
            "time_s": [300.0 - 3 * k for _ in range(3) for k in range(40)],
            "timestamp": [datetime(2026, 1, 1 + i, tzinfo=UTC) for i in range(3) for _ in range(40)],
            "IAS": [280.0 + i for i in range(3) for _ in range(40)],
            "vertical_rate": -2000.0,
        }
    )
    # The second flight shows nothing on the grid.
    frame = frame.filter((pl.col("flight_id") != "f1") | (pl.col("level_fl") < 152))
    quantities = quantities_of(frame, 150, 189, CHANNELS)
    assert quantities.names == ("f0", "f2")
    assert quantities.day is not None
    assert quantities.day.diff().tolist() == [2]
    assert quantities.values["cas"].nanmean(1).tolist() == pytest.approx([280.0, 282.0])
    assert quantities.rows(torch.tensor([False, True])).names == ("f2",)
    assert quantities.rows(torch.tensor([1, 0, 1])).names == ("f2", "f0", "f2")
