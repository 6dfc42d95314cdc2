"""Speed as a Mach number above each flight's own crossover and a CAS below: found, decoded, exported, refused."""

import pytest
import torch
import toys
from scipy.stats import binom
from torch import Tensor

from descentflow.core.errors import ConfigError, DataError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.mixture_parameters import Mixture
from descentflow.exports.descent_graph import DescentGraph
from descentflow.generation.prediction.predictor import DescentPredictor
from descentflow.generation.rejection import sample_descents
from descentflow.physics.airspeed import cas_to_mach, crossover_altitude_m, mach_to_cas_mps
from descentflow.representation.check_checkpoint import check_flies
from descentflow.representation.crossover import find_crossovers
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.fpca.constant_basis import can_be_fitted, fit_constant
from descentflow.representation.linear_curves import evidence_of
from descentflow.representation.profiles import Profiles, infer_drag_n
from descentflow.representation.representation import Representation, Split, fit_representation

LEVELS = torch.arange(150, 371, dtype=torch.float64)
ALTITUDE_M = LEVELS * FL_M
NOMINAL_M = 9000.0


def schedules(n: int, seed: int, *, top_fl: float = 370) -> tuple[Tensor, Tensor, Tensor]:
    """CAS of n flights, their mask and their crossovers: it wanders in waves of some five minutes, in whole knots."""
    generator = torch.Generator().manual_seed(seed)

    def normal() -> Tensor:
        return torch.randn((n, 1), generator=generator, dtype=torch.float64)

    cas, mach = (275 + 12 * normal()) * KT_MPS, 0.755 + 0.012 * normal()
    phase = ALTITUDE_M / 500 + 3 * normal()
    held = torch.minimum(cas.expand(n, len(LEVELS)), mach_to_cas_mps(mach, ALTITUDE_M)) + 0.5 * torch.sin(phase)
    seen = (top_fl + 0 * normal() >= LEVELS).expand(n, len(LEVELS))
    return (held / KT_MPS).round() * KT_MPS, seen, crossover_altitude_m(cas, mach)[:, 0]


@pytest.fixture(scope="module")
def flights() -> Profiles:
    return toys.with_crossovers(toys.flights(200, seed=4))


@pytest.fixture(scope="module")
def parts(flights: Profiles) -> Representation:
    return fit_representation(flights, toys.AIRCRAFT, Split(flights.flight_ids, (), ()))


@pytest.fixture(scope="module")
def model(parts: Representation, flights: Profiles) -> GaussianDensity:
    density = GaussianDensity(parts.decoder.dimension)
    weights = parts.decoder.encode(flights)
    density.mixture = Mixture(torch.ones(1), weights.mean(0)[None], torch.linalg.cholesky(torch.cov(weights.T))[None])
    density.attach(parts)
    return density


def test_intervals_of_crossovers_hold_the_known_ones_as_often_as_they_say() -> None:
    """At least as often as intervals that hold 85 %, where 90 % is stated; one right finder in 10,000 fails."""
    cas, seen, true_m = schedules(400, seed=1)
    inside = (true_m > ALTITUDE_M[5]) & (true_m < ALTITUDE_M[-6])
    found = find_crossovers(cas, seen, ALTITUDE_M, NOMINAL_M)
    low, high, middle = (found.quantile_m(share) for share in (0.05, 0.95, 0.5))
    held = ((true_m >= low) & (true_m <= high))[inside]
    assert int(held.sum()) >= binom.ppf(1e-4, len(held), 0.85)
    # And they are of use: half of the crossovers are found within 300 ft.
    assert float((middle - true_m)[inside].abs().median()) < 3 * FL_M


def test_levels_that_count_as_known_are_in_the_regime_that_is_said() -> None:
    """A level counts as known from 95 %; wrong are fewer by far, for most levels are far from the crossover."""
    cas, seen, true_m = schedules(300, seed=2)
    found = find_crossovers(cas, seen, ALTITUDE_M, NOMINAL_M)
    wrong = found.holds_mach != (true_m[:, None] <= ALTITUDE_M)
    assert float(wrong[found.sure].double().mean()) < 0.005
    assert float(found.sure.double().mean()) > 0.9


def test_a_flight_that_shows_one_regime_says_nothing_of_the_other(parts: Representation, flights: Profiles) -> None:
    low = flights.mask & (ALTITUDE_M < 7500)  # all crossovers are above
    rest = (flights.time_s, flights.cas_mps, flights.rate_mps, flights.drag_n)
    cut = toys.with_crossovers(Profiles(flights.flight_ids, flights.levels_fl, *rest, low))
    _, mach, cas = parts.decoder.observed(cut).masks
    assert not bool(mach.any())
    assert bool((cas.sum(1) > 50).all())
    evidence = evidence_of(parts.decoder, cut)
    place = parts.decoder.drag_basis.n_components
    assert float(evidence.precisions[:, place].abs().max()) < 1e-6  # of the Mach number's weight; the others are near 1
    assert float(evidence.precisions[:, place + 1, place + 1].min()) > 1


def test_a_type_without_a_mach_number_holds_cas() -> None:
    cas, seen, _ = schedules(5, seed=3)
    assert not bool(find_crossovers(cas, seen, ALTITUDE_M, torch.inf).holds_mach.any())


def test_drag_in_either_regime_flies_back_to_the_rates_that_it_was_inferred_from(flights: Profiles) -> None:
    """Two inverse formulae in float64, in the flight's own regime; the type's transition would miss by a tenth."""
    crossovers = flights.crossovers
    assert crossovers is not None
    drag = infer_drag_n(toys.AIRCRAFT, flights.cas_mps, flights.rate_mps, ALTITUDE_M, at_mach=crossovers.holds_mach)
    ahead = torch.where(crossovers.holds_mach, -1.0, 1.0).double()
    entry = flights.entry_level
    flown = integrate(toys.AIRCRAFT, LEVELS, ALTITUDE_M, drag, flights.cas_mps, entry, ahead_mps=ahead)
    torch.testing.assert_close(flown.rate_mps[flights.mask], flights.rate_mps[flights.mask], rtol=1e-11, atol=0)
    nominal = integrate(toys.AIRCRAFT, LEVELS, ALTITUDE_M, drag, flights.cas_mps, entry)
    assert float((nominal.rate_mps / flights.rate_mps)[flights.mask].sub(1).abs().max()) > 0.1


def test_time_does_not_depend_on_where_levels_lie_about_a_crossover() -> None:
    """On levels 100 ft apart as on some 25 ft apart, to 0.01 s of some ten minutes; a trapezoid misses up to 0.5 s."""
    times = []
    for step in (1.0, 0.25):
        levels = torch.arange(200, 350 + step, step, dtype=torch.float64)
        h = levels * FL_M
        crossing = torch.linspace(280.1, 289.9, 40, dtype=torch.float64)[:, None] * FL_M
        cas = torch.full((40, 1), 145.0, dtype=torch.float64)
        by_mach = mach_to_cas_mps(cas_to_mach(cas, crossing), h)
        drag = torch.full((40, len(h)), 40e3, dtype=torch.float64)
        entry = torch.full((40,), len(h) - 1)
        flown = integrate(toys.AIRCRAFT, levels, h, drag, torch.minimum(by_mach, cas), entry, ahead_mps=by_mach - cas)
        times.append(flown.time_s[:, 0])
    assert float((times[0] - times[1]).abs().max()) < 0.01


def test_fast_and_plain_decoding_agree(parts: Representation) -> None:
    decoder = parts.decoder
    weights = torch.randn(30, decoder.dimension, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    curves, fast = decoder.flown_curves(weights), decoder(weights)
    plain = decoder(weights.requires_grad_())
    for name in ("time_s", "rate_mps", "tas_mps", "mach"):
        torch.testing.assert_close(getattr(fast, name), getattr(plain, name).detach(), rtol=1e-10, atol=1e-8)
    assert curves.ahead_mps is not None
    crossing = (curves.ahead_mps[:, 1:] < 0) != (curves.ahead_mps[:, :-1] < 0)
    assert int(crossing.sum()) > 20  # most draws change over on the grid


def test_gradients_of_time_by_the_weights(parts: Representation) -> None:
    """The place of the crossover moves with the weights and with it the time."""
    decoder = parts.decoder
    weights = torch.randn(3, decoder.dimension, generator=torch.Generator().manual_seed(6), dtype=torch.float64)

    def time(w: Tensor) -> Tensor:
        return decoder(w).time_s[:, ::20] / 100

    assert torch.autograd.gradcheck(time, (weights.requires_grad_(),), eps=1e-7, atol=1e-5, rtol=1e-3)


def test_exact_schedules_come_back_from_their_weights(parts: Representation) -> None:
    """Constant Mach, constant CAS: decoded CAS is what was encoded to within the noise that the model allows, 1 kt."""
    real = toys.with_crossovers(toys.flights(50, seed=9, gappy=False))
    curves = parts.decoder.flown_curves(parts.decoder.encode(real))
    assert float((curves.cas_mps - real.cas_mps).abs().mean()) < 0.3 * KT_MPS
    assert float((curves.cas_mps - real.cas_mps).abs().max()) < 2.5 * KT_MPS


def test_a_checkpoint_keeps_it(parts: Representation) -> None:
    again = Representation.from_state(parts.to_state())
    weights = torch.zeros(2, parts.decoder.dimension, dtype=torch.float64)
    white = torch.ones(2, parts.decoder.n_white, dtype=torch.float64)
    one, other = parts.decoder(weights, white=white), again.decoder(weights, white=white)
    assert again.decoder.speed == "mach_cas"
    assert torch.equal(one.time_s, other.time_s)
    check_flies(again.decoder, again.plausibility)
    assert again.decoder.sizes.endswith("1 of Mach, 1 of CAS")


def test_samples_change_over_each_on_its_own(model: GaussianDensity, parts: Representation) -> None:
    drawn = sample_descents(model, parts, 100, seed=0).trajectories
    held = drawn.mach.diff(dim=1).abs() < 5e-4  # from level to level; a CAS that is held makes some 1.4e-3
    changes = (held & drawn.mask[:, 1:]).sum(1).double()
    assert float(changes.std()) > 5


def test_the_exported_graph_flies_what_the_decoder_flies(parts: Representation) -> None:
    decoder, generator = parts.decoder, torch.Generator().manual_seed(7)
    weights = torch.randn(20, decoder.dimension, generator=generator, dtype=torch.float64)
    white = torch.randn(20, decoder.n_white, generator=generator, dtype=torch.float64)
    entry = torch.full((20,), len(LEVELS) - 1)
    graph = DescentGraph(parts)
    assert graph.n_residual == decoder.n_white
    out = graph(weights, torch.full((20,), 370.0), white)
    flown = decoder(weights, entry, white=white)
    torch.testing.assert_close(out["time_s"], flown.time_s, rtol=0, atol=1e-8)
    torch.testing.assert_close(out["CAS"], flown.cas_mps / KT_MPS, rtol=0, atol=1e-9)


def test_a_flight_still_at_its_mach_number_goes_on_from_there(model: GaussianDensity, flights: Profiles) -> None:
    assert flights.crossovers is not None
    tall = torch.nonzero(flights.crossovers.holds_mach[:, 180] & (flights.entry_level > 210))[:1, 0]
    from_fl = float(flights.levels_fl[190])
    ahead = DescentPredictor(model).predict(flights.subset(tall), from_fl, n=100, seed=0).trajectories
    at_start = ahead.mach[:, 191] - ahead.mach[:, 190]
    assert bool((at_start.abs() < 5e-4).all())  # none has changed over yet


def test_flights_of_one_way_are_refused_by_the_other(parts: Representation) -> None:
    with pytest.raises(ConfigError, match="mach_cas"):
        parts.decoder.encode(toys.flights(3))


def test_deviations_are_not_taken_from_who_shows_a_level() -> None:
    """Slow flights alone hold CAS high up: two knots of deviation stay two knots there, of means 30 kt apart."""
    generator = torch.Generator().manual_seed(12)
    slow = torch.rand((400, 1), generator=generator) < 0.5
    cas = torch.where(slow, 120.0, 136.0) + 2 * torch.randn((400, 1), generator=generator)
    held = (cas + 0.4 * torch.randn((400, 221), generator=generator)).double()
    seen = torch.where(slow, 210, 150) > torch.arange(221)
    basis = fit_constant(held, seen, FL_M)
    assert float(basis.left_out().square().sum(1).sqrt().max()) < 0.5
    assert float(basis.mean[:200].max() - basis.mean[:200].min()) < 0.3
    assert float(basis.mean.mean()) == pytest.approx(float(cas.mean()), abs=0.3)


def test_no_flights_have_no_weights(parts: Representation, flights: Profiles) -> None:
    assert parts.decoder.encode(flights.subset([])).shape == (0, parts.decoder.dimension)


def test_too_few_flights_at_a_mach_number_are_refused() -> None:
    cas, seen, _ = schedules(5, seed=8)
    with pytest.raises(DataError, match=r"data\.speed: cas"):
        fit_constant(cas, seen, FL_M, "Mach number")


def test_one_speed_of_all_flights_is_refused() -> None:
    """Copies of one flight, or a simulator that always flies the same Mach number, leave nothing to fit."""
    mach, seen = torch.full((30, 60), 0.78).double(), torch.ones(30, 60, dtype=torch.bool)
    with pytest.raises(DataError, match="identical"):
        fit_constant(mach, seen, FL_M, "Mach number")
    assert not can_be_fitted(mach, seen)
    assert can_be_fitted(mach + 1e-4 * torch.arange(30)[:, None], seen)


def test_the_integrator_takes_slopes_and_own_regimes_together(parts: Representation) -> None:
    decoder: DescentDecoder = parts.decoder
    curves = decoder.flown_curves(torch.zeros(1, decoder.dimension, dtype=torch.float64))
    entry = torch.tensor([len(LEVELS) - 1])
    windy = integrate(
        toys.AIRCRAFT, LEVELS, ALTITUDE_M, *curves[:2], entry,
        wind_mps=torch.zeros_like(curves.cas_mps), ahead_mps=curves.ahead_mps,
    )  # fmt: skip
    torch.testing.assert_close(windy.time_s, decoder(torch.zeros(1, decoder.dimension).double()).time_s)
