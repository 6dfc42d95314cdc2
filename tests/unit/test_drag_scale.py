"""The logarithm of drag minus idle thrust: its inverse, what it makes of any weights, and what it does for samples."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch
import toys
from scipy.stats import ks_2samp

from descentflow.core.errors import CheckpointError
from descentflow.core.units import FL_M
from descentflow.densities.checkpoint import load_model
from descentflow.densities.gaussian import GaussianDensity
from descentflow.evaluation.figures.components import components_figure
from descentflow.physics.nominal_descent import nominal_state
from descentflow.representation.drag_scale import LEAST_FORCE, DragScale, fit_drag_scale
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation, Split, fit_representation
from descentflow.training.fit import fit
from descentflow.training.models import Gaussian

SCALE = DragScale(torch.tensor([900.0, 1100.0]).double(), 30_000.0)


def parts(flights: Profiles, **options: object) -> Representation:
    return fit_representation(flights, toys.AIRCRAFT, Split(flights.flight_ids, (), ()), **options)  # type: ignore[arg-type]


def test_drag_comes_back_and_a_newton_is_a_newton_about_the_typical_force() -> None:
    drag_n = torch.linspace(5_000, 200_000, 50).double()[:, None].expand(-1, 2)
    torch.testing.assert_close(SCALE.drag_n(SCALE.scaled(drag_n)), drag_n, rtol=1e-14, atol=0)
    typical = (SCALE.thrust_n + SCALE.force_n)[None].requires_grad_()
    (slope,) = torch.autograd.grad(SCALE.scaled(typical).sum(), typical)
    torch.testing.assert_close(slope, torch.ones_like(slope))
    assert float(SCALE.scaled(typical.detach()).abs().max()) < 1e-9
    scaled = torch.randn(4, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda z: SCALE.drag_n(1e4 * z) / 1e4, (scaled,))


def test_what_hardly_descends_has_the_least_force() -> None:
    climbing = torch.tensor([[-5_000.0, 1_000.0]]).double()
    assert torch.allclose(SCALE.drag_n(SCALE.scaled(climbing)), SCALE.thrust_n + LEAST_FORCE * SCALE.force_n)


def test_the_scale_is_about_the_mean_net_retarding_force() -> None:
    flights = toys.flights(50)
    scale = fit_drag_scale(flights, toys.AIRCRAFT)
    thrust_n = nominal_state(toys.AIRCRAFT, flights.levels_fl * FL_M).thrust_n
    assert scale.force_n == pytest.approx(float((flights.drag_n - thrust_n)[flights.mask].mean()))
    assert torch.equal(scale.thrust_n, thrust_n)


def test_all_weights_descend() -> None:
    """Six standard deviations of every weight, and of what lies beyond the components."""
    decoder = parts(toys.flights(200)).decoder
    generator = torch.Generator().manual_seed(0)
    weights = 6 * torch.randn(500, decoder.dimension, generator=generator).double()
    flown = decoder(weights, white=6 * torch.randn(500, decoder.n_white, generator=generator).double())
    assert bool((flown.rate_mps < 0).all())
    in_newtons = parts(toys.flights(200), drag_scale="newton").decoder
    assert in_newtons.drag_scale is None
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
    white = torch.randn(20_000, known.decoder.n_white, generator=torch.Generator().manual_seed(3)).double()
    with torch.no_grad():
        drawn = known.decoder(density.sample(20_000, seed=0), white=white).drag_n
    p = [ks_2samp(drawn[:, i].numpy(), test.drag_n[:, i].numpy()).pvalue for i in range(10, 210, 40)]
    assert (float(min(p)) > 1e-4) == (scale == "log"), p


def test_a_checkpoint_keeps_the_scale_and_one_of_before_flies_as_it_did(tmp_path: Path) -> None:
    path = tmp_path / "descents.parquet"
    toys.write_descents_file(path, 120)
    fit(path, Gaussian(), out=tmp_path / "log.ckpt")
    fit(path, Gaussian(), out=tmp_path / "newton.ckpt", drag_scale="newton")
    kept = load_model(tmp_path / "log.ckpt").representation.decoder.drag_scale
    assert kept is not None
    assert kept.force_n > 10_000
    content = torch.load(tmp_path / "newton.ckpt", weights_only=True)
    assert "drag_scale" not in content["descentflow"]["representation"]["decoder"], "as checkpoints of before"
    assert load_model(tmp_path / "newton.ckpt").representation.decoder.drag_scale is None
    for wrong in ({"thrust_n": kept.thrust_n[:5], "force_n": 3e4}, {"thrust_n": kept.thrust_n, "force_n": -1.0}, {}):
        content["descentflow"]["representation"]["decoder"]["drag_scale"] = wrong
        torch.save(content, tmp_path / "wrong.ckpt")
        with pytest.raises(CheckpointError):
            load_model(tmp_path / "wrong.ckpt")


def test_the_figure_of_components_is_in_kilonewtons() -> None:
    decoder = parts(toys.flights(100)).decoder
    figure = components_figure(decoder.drag_basis, decoder.cas_basis, decoder.levels_fl, drag_scale=decoder.drag_scale)
    mean = next(line for line in figure.axes[0].lines if line.get_label() == "mean").get_xdata()
    expected = toys.flights(100).drag_n.mean() / 1000
    assert abs(float(mean.mean()) - float(expected)) < 0.1 * float(expected)
