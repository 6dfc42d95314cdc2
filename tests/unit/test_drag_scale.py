"""The scale of drag: its inverse, rates without steps, what it makes of any weights, and what it does for samples."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
import toys
from scipy.stats import ks_2samp

from descentflow.air.energy_in_air import drag_in_air
from descentflow.air.level_air import LevelAir
from descentflow.core.errors import CheckpointError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.densities.checkpoint import load_model
from descentflow.densities.gaussian import GaussianDensity
from descentflow.physics.airspeed import cas_to_mach, cas_to_tas_mps, mach_to_cas_mps
from descentflow.representation.decoder.trajectories import integrate
from descentflow.representation.drag_scale import LEAST_FORCE, DragScale, fit_drag_scale
from descentflow.representation.fit_representation import RepresentationSettings, fit_representation
from descentflow.representation.own_air import flown_in
from descentflow.representation.profiles import Profiles, profiles_with_drag
from descentflow.representation.representation import Representation, Split
from descentflow.training.fit import fit
from descentflow.training.models import Gaussian

SCALE = DragScale(
    torch.tensor([900.0, 1100.0]).double(),
    torch.tensor([36_000.0, 24_000.0]).double(),
    torch.tensor([140.0, 130.0]).double(),
    torch.tensor([0.002, 0.001]).double(),
    30_000.0,
)


def parts(flights: Profiles, **options: object) -> Representation:
    return fit_representation(
        flights, toys.AIRCRAFT, Split(flights.flight_ids, (), ()), RepresentationSettings(**options)
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("scale", [SCALE, replace(SCALE, logarithm=False)], ids=["log", "newton"])
def test_drag_comes_back(scale: DragScale) -> None:
    drag_n = torch.linspace(5_000, 200_000, 50).double()[:, None].expand(-1, 2)
    cas_mps = torch.linspace(120, 170, 50).double()[:, None].expand(-1, 2)
    torch.testing.assert_close(scale.drag_n(scale.scaled(drag_n, cas_mps), cas_mps), drag_n, rtol=1e-14, atol=0)


def test_what_hardly_descends_has_the_least_force() -> None:
    climbing = torch.tensor([[-5_000.0, 1_000.0]]).double()
    least = SCALE.thrust_n + LEAST_FORCE * SCALE.force_n
    drag_n = SCALE.drag_n(SCALE.scaled(climbing, SCALE.cas_mps), SCALE.cas_mps)
    torch.testing.assert_close(drag_n, least[None])


def one_angle(speeds: list[float], mach: float) -> Profiles:
    """Flights at one Mach number and a CAS each (m/s) that descend at an angle of 7.5 % at every level."""
    levels = torch.arange(150, 391, dtype=torch.float64)
    cas = torch.minimum(torch.tensor(speeds).double()[:, None], mach_to_cas_mps(mach, levels * FL_M))
    rate = -0.075 * cas_to_tas_mps(cas, levels * FL_M)
    flights = tuple(map(str, range(len(speeds))))
    return profiles_with_drag(toys.AIRCRAFT, flights, levels, 0 * cas, cas, rate, torch.ones_like(cas) > 0)


def test_the_typical_force_is_that_of_one_angle_and_steps_as_the_manuals_factor() -> None:
    """Weight over factor: user manual 3.2-8 to 3.2-11, written out here; between 260 and 340 kt to 0.2 %."""
    flights = one_angle([260 * KT_MPS, 300 * KT_MPS, 340 * KT_MPS], 0.78)
    scale = fit_drag_scale(flights, toys.AIRCRAFT)
    below = flights.altitude_m < float(toys.AIRCRAFT.transition_altitude_m())
    number = cas_to_mach(flights.cas_mps, flights.altitude_m)
    y = 1 + 0.2 * number**2
    lapse = torch.where(flights.altitude_m < 11_000, -1.4 * 287.05287 * 0.0065 / (2 * 9.80665) * number**2, 0.0)
    expected = 0.075 * 64_000 * 9.80665 * (1 + lapse + torch.where(below, y - y**-2.5, 0.0))
    torch.testing.assert_close(scale.typical_n(flights.cas_mps), expected, rtol=2e-3, atol=0)
    assert float(scale.force_n.log().diff().abs().max()) > 0.25


def in_wind(flights: Profiles) -> tuple[Profiles, LevelAir]:
    """The same rates, flown in a wind along the track that grows with height."""
    still = LevelAir.uniform(flights.levels_fl, deviation_k=12.0)
    air = LevelAir(still.deviation_k, still.tailwind_mps + 0.004 * flights.altitude_m)
    drag_n = drag_in_air(toys.AIRCRAFT, flights.cas_mps, flights.rate_mps, flights.drag_n, flights.altitude_m, air)
    return replace(flights, drag_n=drag_n), air


@pytest.mark.parametrize("scale", ["log", "newton"])
@pytest.mark.parametrize("windy", [False, True])
@pytest.mark.parametrize("n", [20, 300, pytest.param(1000, marks=pytest.mark.slow)])
def test_rates_have_no_step(n: int, windy: bool, scale: str) -> None:
    """Of the mean weights, and of slow and fast ones; flights' rates have none, and inferred drag one of a quarter."""
    flights = toys.flights(n, seed=7, top_fl=390)
    shown, air = in_wind(flights) if windy else (flights, None)
    decoder = parts(shown, drag_scale=scale).decoder
    weights = torch.zeros(3, decoder.dimension, dtype=torch.float64)
    weights[1:, decoder.drag_basis.n_components] = torch.tensor([-2.0, 2.0])
    flown = decoder(weights)
    flown = flown if air is None else flown_in(toys.AIRCRAFT, flown, air)
    assert float((-flown.rate_mps).log().diff(dim=1).abs().max()) < (0.02 if windy else 0.01)
    assert float(flown.drag_n.log().diff(dim=1).abs().max()) > 0.15


@pytest.mark.parametrize("scale", ["log", "newton"])
def test_what_a_flight_shows_is_flown_as_it_was_observed(scale: str) -> None:
    """Inference and decoder are inverse to rounding, in the flights' own air too."""
    flights = toys.flights(30, gappy=False, top_fl=390)
    for shown, air in ((flights, None), in_wind(flights)):
        decoder = parts(shown, drag_scale=scale).decoder
        scaled, cas_mps = decoder.drag_scale.observed(shown).values
        drag_n = decoder.drag_scale.drag_n(scaled, cas_mps)
        entry = torch.full((30,), len(flights.levels_fl) - 1)
        flown = integrate(toys.AIRCRAFT, flights.levels_fl, flights.altitude_m, drag_n, cas_mps, entry)
        in_air = flown if air is None else flown_in(toys.AIRCRAFT, flown, air)
        torch.testing.assert_close(in_air.rate_mps, flights.rate_mps, rtol=1e-11, atol=0)


def test_all_weights_descend() -> None:
    """Six standard deviations of every weight, and of what lies beyond the components."""
    decoder = parts(toys.flights(200)).decoder
    generator = torch.Generator().manual_seed(0)
    weights = 6 * torch.randn(500, decoder.dimension, generator=generator).double()
    residual = 6 * torch.randn(500, decoder.residuals.n_numbers, generator=generator).double()
    flown = decoder(weights, residual=residual)
    assert bool((flown.rate_mps < 0).all())
    in_newtons = parts(toys.flights(200), drag_scale="newton").decoder
    assert bool((in_newtons(weights[:, : in_newtons.dimension]).rate_mps > 0).any())


def skewed(n: int, seed: int) -> Profiles:
    """Flights whose net retarding force is lognormal, a factor of two at two standard deviations."""
    flights = toys.flights(n, gappy=False, seed=seed)
    white = torch.randn(n, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    x = torch.linspace(0, 1, len(flights.levels_fl)).double()
    shape = white[:, :1] + 0.6 * white[:, 1:2] * torch.sin(4 * x) + 0.6 * white[:, 2:] * torch.cos(5 * x)
    return replace(flights, drag_n=900 + 30_000 * torch.exp(0.35 * shape))


@pytest.mark.parametrize("scale", ["log", "newton"])
def test_a_gaussian_has_the_quantiles_of_skewed_flights_on_the_scale_alone(scale: str) -> None:
    """Kolmogorov-Smirnov at five levels, 2,000 flights against 20,000 draws: p > 1e-4 fails one right one in 2,000."""
    train, test = skewed(2_000, seed=1), skewed(2_000, seed=2)
    known = parts(train, drag_scale=scale, explained_variance=0.99)
    density, weights = GaussianDensity(known.decoder.dimension), known.decoder.encode(train)
    density.loc.data, density.scale_tril.data = weights.mean(0), torch.linalg.cholesky(torch.cov(weights.T))
    residuals, generator = known.decoder.residuals, torch.Generator().manual_seed(3)
    with torch.no_grad():
        w, uniform = density.sample(20_000, seed=0), torch.rand(20_000, generator=generator)
        entry = torch.full((20_000,), len(train.levels_fl) - 1)
        drawn = known.decoder(w, entry, residual=residuals.draw(w, entry, uniform)).drag_n
    p = [ks_2samp(drawn[:, i].numpy(), test.drag_n[:, i].numpy()).pvalue for i in range(10, 210, 40)]
    assert (float(min(p)) > 1e-4) == (scale == "log"), p


def test_a_checkpoint_keeps_the_scale_and_one_of_before_says_to_fit_again(tmp_path: Path) -> None:
    path = tmp_path / "descents.parquet"
    toys.write_descents_file(path, 120)
    fitted = fit(path, Gaussian(), out=tmp_path / "newton.ckpt", drag_scale="newton", final=False)
    made, kept = (one.representation.decoder.drag_scale for one in (fitted, load_model(tmp_path / "newton.ckpt")))
    assert not kept.logarithm
    assert torch.equal(kept.force_n, made.force_n)
    content = torch.load(tmp_path / "newton.ckpt", weights_only=True)
    state = kept.to_state()
    for wrong, message in (
        (None, "decoder.drag_scale"),  # as theirs in newtons
        ({**state, "thrust_n": kept.thrust_n[:5]}, "not of this grid"),
        ({**state, "force_n": -kept.force_n}, "not of this grid"),
        ({**state, "unit_n": 0.0}, "not of this grid"),
    ):
        content["descentflow"]["representation"]["decoder"]["drag_scale"] = wrong
        torch.save(content, tmp_path / "wrong.ckpt")
        with pytest.raises(CheckpointError, match=message):
            load_model(tmp_path / "wrong.ckpt")
