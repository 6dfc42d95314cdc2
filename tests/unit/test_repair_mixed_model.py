"""The mixed model of the repair against dense matrices, and its partial pooling."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from descentflow.repairs.mixed_model import (
    PRIOR,
    Flights,
    Sizes,
    before_flights,
    fit,
    posterior,
    predictive_log_density,
    type_covariance,
)

SIZES = Sizes(0.05, 0.1, 0.07, 0.06, 0.03, 0.05, 1.2, (0.3, 0.4))


def flights_of(y: np.ndarray | None = None, seed: int = 0, types: int = 2, n: int = 12) -> Flights:
    """Flights of some types, three an aircraft, of which a third of the bands is not seen."""
    rng = np.random.default_rng(seed)
    bands = 5
    x, by_mass = rng.normal(size=(n, bands, 3)), rng.normal(size=(n, bands))
    kind = np.arange(n) // (n // types)
    seen = rng.uniform(size=(n, bands)) > 0.3
    y = rng.normal(size=(n, bands)) if y is None else y
    groups = np.array([[0] * types, list(range(types))])
    return Flights(np.where(seen, y, 0.0), x, by_mass, seen, kind, np.arange(n) // 3, 700.0 * np.arange(bands), groups)


def dense(flights: Flights, sizes: Sizes) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Covariance of all seen numbers, their columns by the coefficients of all types, and their values."""
    at = np.argwhere(flights.seen)
    flight, band = at.T
    alike = flight[:, None] == flight
    noise = sizes.aircraft**2 * (flights.tail[flight][:, None] == flights.tail[flight])
    mass, kind = flights.by_mass[flight, band], flights.kind[flight]
    misfit = sizes.equation**2 * (flights.shapes @ flights.shapes.T)[band][:, band]
    noise = noise + (kind[:, None] == kind) * misfit
    noise = noise + alike * (sizes.flight**2 + sizes.mass**2 * np.outer(mass, mass))
    noise = noise + alike * sizes.smooth**2 * flights.kernel[band][:, band] + sizes.white**2 * np.eye(len(at))
    columns = np.zeros((len(at), 3 * flights.types))
    for row, (f, b) in enumerate(at):
        columns[row, 3 * flights.kind[f] : 3 * flights.kind[f] + 3] = flights.x[f, b]
    return noise, columns, flights.y[flight, band]


def test_posterior_and_marginal_likelihood_are_those_of_dense_matrices() -> None:
    flights = flights_of()
    noise, columns, y = dense(flights, SIZES)
    prior = type_covariance(flights.groups, SIZES)
    whole = noise + columns @ prior @ columns.T
    gain = prior @ columns.T @ np.linalg.inv(whole)
    fitted = posterior(flights, SIZES)
    np.testing.assert_allclose(fitted.mean.ravel(), gain @ y, atol=1e-9)
    for kind in range(flights.types):
        at = slice(3 * kind, 3 * kind + 3)
        np.testing.assert_allclose(fitted.of(kind)[1], (prior - gain @ columns @ prior)[at, at], atol=1e-9)
    constant = -0.5 * len(y) * np.log(2 * np.pi)
    assert fitted.log_likelihood + constant == pytest.approx(multivariate_normal(cov=whole).logpdf(y), abs=1e-6)


def test_predictive_density_is_the_ratio_of_two_marginal_likelihoods() -> None:
    flights = flights_of()
    new = flights.tail == flights.tail[-1]
    old = posterior(flights.rows(np.flatnonzero(~new)), SIZES)
    whole = posterior(flights, SIZES).log_likelihood
    log_density = predictive_log_density(flights.rows(np.flatnonzero(new)), old)
    assert log_density[0] == pytest.approx(whole - old.log_likelihood, abs=1e-6)


@pytest.mark.parametrize(("apart", "pooled"), [(0.0, True), (0.6, False)])
def test_pooling_of_sisters_is_learnt(apart: float, pooled: bool) -> None:
    """A type with two flights follows many that are wrong alike, and none where they differ."""
    rng = np.random.default_rng(1)
    types, n, bands = 8, 20, 6
    size = 0.4 + apart * np.where(np.arange(types) % 2, 1.0, -1.0)
    kind = np.repeat(np.arange(types), n)
    x = np.zeros((types * n, bands, 3))
    x[:, :, 0] = 0.7
    y = 0.7 * size[kind][:, None] + 0.1 * rng.normal(size=(types * n, 1)) + 0.03 * rng.normal(size=(types * n, bands))
    kept = np.flatnonzero((kind > 0) | (np.arange(types * n) < 2))
    ones = np.ones(y.shape)
    groups = np.array([[0] * types])
    flights = Flights(y, x, 0 * ones, ones > 0, kind, np.arange(types * n), 700.0 * np.arange(bands), groups)
    model = fit(flights.rows(kept))
    assert (model.sizes.weights[0] > 0.7) is pooled


def test_few_flights_are_no_worse_than_the_prior_on_average() -> None:
    """Held-out log score of three flights' posterior against the prior's, over files as wrong as the prior has it."""
    rng, gains, sizes = np.random.default_rng(0), [], Sizes()
    for seed in range(60):
        flights = replace(flights_of(seed=seed, types=1), groups=np.zeros((0, 1), int))
        noise, columns, _ = dense(flights, sizes)
        y = np.zeros(flights.y.shape)
        y[flights.seen] = rng.multivariate_normal(np.zeros(len(noise)), noise + columns @ PRIOR @ columns.T)
        flights = replace(flights, y=y)
        few, rest = flights.rows(np.arange(3)), flights.rows(np.arange(3, 12))
        nothing = before_flights(flights, sizes)
        after, before = (predictive_log_density(rest, one).sum() for one in (posterior(few, sizes), nothing))
        gains.append(after - before)
    assert np.mean(gains) > 0
