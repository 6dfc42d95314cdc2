"""Whitening with gaps, false discoveries, and the selection of effects on flights of known shift."""

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch

from descentflow.aircraft_types.open_types.open_aircraft import open_aircraft
from descentflow.diagnosis.inference import heterogeneity
from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.permutation import null_test
from descentflow.diagnosis.inference.selection import select
from descentflow.diagnosis.inference.two_sides import Compared, compare
from descentflow.diagnosis.inference.uncertainty import covariance
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.diagnosis.report.causes import parameters
from descentflow.effects import EFFECTS
from descentflow.measurements.quantities import Quantities

NONE_APART = torch.zeros(3, dtype=torch.bool)


def test_whitening_knows_the_covariance_behind_gaps() -> None:
    generator = torch.Generator().manual_seed(0)
    root = torch.tensor([[1.0, 0.0, 0.0], [0.8, 0.6, 0.0], [0.5, 0.5, 0.7]], dtype=torch.float64)
    y = torch.randn(4000, 3, generator=generator, dtype=torch.float64) @ root.T + 5.0
    y[:1000, 2] = torch.nan
    alone = torch.arange(4000)
    found = whiten(y, torch.ones(4000, dtype=torch.bool), alone, torch.zeros(3, dtype=torch.float64), NONE_APART[:3])
    torch.testing.assert_close(found.covariance, root @ root.T, atol=0.06, rtol=0)
    seen = found.precision[found.pattern[0]]
    assert bool((seen[2] == 0).all())
    torch.testing.assert_close(seen[:2, :2], torch.linalg.inv(found.covariance[:2, :2]), rtol=1e-6, atol=1e-6)


def test_precisions_of_many_patterns_are_applied_flight_by_flight() -> None:
    """Patterns that as many flights show are worked out together, and a flight's own one counts all the same."""
    generator = torch.Generator().manual_seed(3)
    y = torch.randn(300, 6, generator=generator, dtype=torch.float64)
    y[torch.rand(300, 6, generator=generator) < 0.2] = torch.nan
    none = torch.zeros(6, dtype=torch.float64)
    found = whiten(y, torch.ones(300, dtype=torch.bool), torch.arange(300), none, none.bool())
    some = torch.arange(7, 300, 3)
    for part, shown in ((found, y), (found.rows(some), y[some])):
        values = torch.where(shown.isfinite(), shown, 0.0)
        columns = values[:, :, None] * torch.tensor([1.0, 0.0, -2.0]).double()
        columns[:, :2] = 0.0
        own = part.precision[part.pattern]
        assert bool(((own.diagonal(dim1=1, dim2=2) != 0) == shown.isfinite()).all())
        torch.testing.assert_close(part.apply(values), torch.einsum("npq,nq->np", own, values))
        torch.testing.assert_close(part.apply(columns), torch.einsum("npq,nqk->npk", own, columns))
        torch.testing.assert_close(part.total(torch.ones(len(own))), own.sum(0))


def test_flights_that_show_less_are_weighed_as_if_nothing_were_known_before() -> None:
    generator = torch.Generator().manual_seed(4)
    y = torch.randn(200, 5, generator=generator, dtype=torch.float64)
    y[:50, 4] = torch.nan
    none = torch.zeros(5, dtype=torch.float64)
    found = whiten(y, torch.ones(200, dtype=torch.bool), torch.arange(200), none, none.bool())
    seen = y.isfinite()
    seen[30:90, 1:3] = False
    hidden, anew = found.hiding(seen), found.only(torch.arange(5), seen)
    torch.testing.assert_close(hidden.precision[hidden.pattern], anew.precision[anew.pattern])


def test_what_aircraft_share_counts_once() -> None:
    """With five flights an aircraft that share all of one entry, its variance for means is five times larger."""
    generator = torch.Generator().manual_seed(1)
    cluster = torch.arange(1000) // 5
    y = torch.randn(1000, 2, generator=generator, dtype=torch.float64)
    y[:, 0] = y[::5, 0].repeat_interleave(5)
    found = whiten(y, torch.ones(1000, dtype=torch.bool), cluster, torch.zeros(2, dtype=torch.float64), NONE_APART[:2])
    variance = torch.linalg.inv(found.precision[0]).diagonal()
    assert float(variance[0]) == pytest.approx(5.0, rel=0.2)
    assert float(variance[1]) == pytest.approx(1.0, rel=0.2)


def test_no_single_flight_is_known_better_than_what_is_negligible() -> None:
    """All flights learnt from show one height to the last digit: those of a simulator in standard air do."""
    generator = torch.Generator().manual_seed(2)
    y = torch.randn(300, 2, generator=generator, dtype=torch.float64)
    y[:, 1] = 1e-13 * y[:, 1]
    everyone, least = torch.ones(300, dtype=torch.bool), torch.tensor([0.1, 1.0], dtype=torch.float64)
    found = whiten(y, everyone, torch.arange(300), torch.zeros(2).double(), NONE_APART[:2], least=least)
    assert float(found.between[1, 1]) == pytest.approx(1.0)
    assert float(found.between[0, 0]) == pytest.approx(1.0, rel=0.3)
    assert float(found.of_single_flights(torch.arange(len(y)), y.isfinite()).precision.abs().max()) < 2.0


def planted(halves: tuple[Quantities, Quantities], name: str, theta: list[float]) -> Compared:
    """The halves compared, with an effect's own shift added to the second."""
    compared = compare(*halves, open_aircraft("A320"))
    if not name:
        return compared
    shift = compared.vector(EFFECTS[name].shift(compared.state, torch.tensor(theta, dtype=torch.float64)))
    return dataclasses.replace(compared, y=compared.y + torch.where(compared.real[:, None], shift, 0.0))


def likelihood(compared: Compared, *, blind: bool = False) -> EffectsLikelihood:
    groups = torch.ones_like(compared.real) if blind else compared.real
    weights = whiten(compared.y, groups, compared.airframe, compared.nugget(), compared.of_flight())
    return EffectsLikelihood(compared, weights, EFFECTS, seed=0)


def with_least_noise(half: Quantities, share: float) -> Quantities:
    """Flights of which so many show the least noise of IAS, and the others up to three quarters more."""
    n = len(half)
    above = torch.linspace(-share / (1 - share), 1.0, n, dtype=torch.float64).clamp(min=0.0)
    return dataclasses.replace(half, values={**half.values, "noise_cas": -0.7 + 0.55 * above})


def test_extremes_of_both_sides_are_drawn_in_alike(halves: tuple[Quantities, Quantities]) -> None:
    """More than half of one side show the least noise, and fewer than half of the other."""
    compared = compare(with_least_noise(halves[0], 0.51), with_least_noise(halves[1], 0.49), open_aircraft("A320"))
    noise = compared.y[:, compared.columns("noise_cas")[0]]
    assert float(noise[compared.real].max()) == pytest.approx(float(noise[~compared.real].max()), abs=0.02)


def test_an_odd_flight_is_drawn_in_on_either_side(halves: tuple[Quantities, Quantities]) -> None:
    odd = [dataclasses.replace(half, values={**half.values, "cas": half.values["cas"].clone()}) for half in halves]
    for half in odd:
        half.values["cas"][0] += 500.0
    compared, plain = (compare(*both, open_aircraft("A320")) for both in (odd, halves))
    at = compared.columns("cas")
    assert float((compared.y[:, at] - plain.y[:, at]).nan_to_num(0.0).abs().max()) < 400.0


@pytest.mark.parametrize(
    ("name", "theta"),
    [
        ("drag_polar", [0.12]),
        ("temperature", [8.0]),
        ("airspeed_bias", [2.0, 2.0]),
        ("speed_brake", [0.3, 200, 240, 1, 0, 0, 0, 0]),
    ],
)
def test_a_planted_shift_is_named_with_its_size(
    halves: tuple[Quantities, Quantities], name: str, theta: list[float]
) -> None:
    held = likelihood(planted(halves, name, theta))
    chosen = select(held, discrepancy_columns(held.compared), lambda _: None)
    assert chosen.fit.effects == (name,)
    assert not chosen.outside.named
    error = covariance(held, chosen.fit).diagonal().sqrt()
    off = (chosen.fit.theta[name] - torch.tensor(theta, dtype=torch.float64)).abs()
    assert float(off[0]) < 4 * float(error[0]) + 1e-3


def test_a_null_is_a_null_and_a_shift_is_none(halves: tuple[Quantities, Quantities]) -> None:
    def p_value(name: str, theta: list[float]) -> float:
        held = likelihood(planted(halves, name, theta), blind=True)
        return null_test(held, discrepancy_columns(held.compared), 318.0, seed=0, count=99).p_value

    assert p_value("", []) > 0.03
    assert p_value("mass", [-0.2]) == pytest.approx(0.01)


def test_a_state_survives_its_checkpoint(halves: tuple[Quantities, Quantities], tmp_path: Path) -> None:
    torch.save(halves[0].to_state(), tmp_path / "state.pt")
    again = Quantities.from_state(torch.load(tmp_path / "state.pt", weights_only=True))
    torch.testing.assert_close(again.values["cas"], halves[0].values["cas"], rtol=1e-6, atol=1e-5, equal_nan=True)
    assert torch.equal(again.airframe, halves[0].airframe)


def test_a_share_is_known_as_well_as_a_count(halves: tuple[Quantities, Quantities]) -> None:
    held = likelihood(planted(halves, "", []))
    theta = torch.tensor([0.36, 200.0, 240.0, 0.6, 0.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    errors = torch.tensor([0.02, 0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    n = int(held.real.sum())
    found = parameters(EFFECTS["speed_brake"], theta, errors, n)
    sd = (0.6 * 0.4 / n) ** 0.5
    assert found["share"].high == pytest.approx(0.6 + 1.645 * sd)
    # How an aircraft answers comes on top of what the data say of an edge.
    assert found["low_fl"].high - 200.0 == pytest.approx(1.645 * (0.5**2 + 0.6**2) ** 0.5)
    assert "ln_ratio_noise" not in found
    theta[3] = 1.0
    assert parameters(EFFECTS["speed_brake"], theta, errors, n)["share"].low is None


@pytest.mark.parametrize("holds", [True, False])
def test_a_share_of_the_flights_must_show_in_their_spread(monkeypatch: pytest.MonkeyPatch, holds: bool) -> None:
    generator = torch.Generator().manual_seed(1)
    real = torch.arange(800) >= 400
    shares = 0.3 * torch.randn(800, generator=generator, dtype=torch.float64)
    # Both have mean one: three in ten flights hold a path, or all flights are a little slower.
    taken = torch.rand(800, generator=generator) < 0.3
    shares = shares + torch.where(real, torch.where(taken, 1 / 0.3, 0.0) if holds else 1.0, 0.0)
    monkeypatch.setattr(heterogeneity, "_shares", lambda likelihood, fit, name: (None, shares, None))
    sides = SimpleNamespace(catalogue=EFFECTS, real=real, has_reference=True)
    fit = SimpleNamespace(theta={"geometric_path": torch.tensor([0.3, 0.1, 0.0], dtype=torch.float64)}, per_flight={})
    assert heterogeneity.spreads_as_claimed(sides, fit, "geometric_path") == holds
