"""Bases, scaler, bounds and residual, fitted before any density to the training flights alone."""

from dataclasses import dataclass
from typing import Any

import torch
from jsonargparse.typing import NonNegativeFloat, OpenUnitInterval, PositiveFloat
from torch import Tensor

from descentflow.core.arguments import checked_settings
from descentflow.core.errors import DataError
from descentflow.core.units import FL_M
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.airspeed_error import TEMPERATURE_K
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.drag_scale import DragScale, DragScaleName, fit_drag_scale
from descentflow.representation.evidence import Gaps
from descentflow.representation.flight_parts import Top
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.fpca.gappy import Method, fit_components
from descentflow.representation.fpca.mask_groups import group_masks
from descentflow.representation.fpca.ppca import posterior
from descentflow.representation.fpca.roughness import SPREAD_WEIGHT, smoother
from descentflow.representation.linear_curves import has_noise_model
from descentflow.representation.plausibility import MARGIN, Bounds, Plausibility
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation, Split
from descentflow.representation.residuals import Residuals

CAS_SHARE = 0.95
"""Share of the variance of CAS that components explain, for operators' speeds lie apart by little."""
MOST_FLIGHTS = 500
"""Training flights whose residuals are kept, evenly taken: with three times as many samples are as near."""


@checked_settings
@dataclass(frozen=True)
class RepresentationSettings:
    """Settings by which flights become weights.

    Attributes:
        explained_variance: Share of variance that the components of drag explain.
        cas_explained_variance: Share of variance that the components of CAS explain.
        fpca: Gappy fPCA algorithm: ``ppca`` or the paper's ``iterative``.
        margin: Share by which the plausibility bounds lie outside the extremes of the training flights; 0.05 in the
            paper (section 2.4).
        bounds: What samples are held to: ``expected``, extremes as of 3,000 training flights or more, and changes from
            level to level; or ``paper``, extremes as observed.
        residual: Whether samples have the drag and the speed of training flights beyond the components; never with
            ``iterative``, which does not know them.
        drag_scale: Scale on which drag is linear in the weights: ``log``, the logarithm of drag minus idle thrust, so
            that all weights descend; or ``newton``, as in the paper.
        gaps: What densities are fitted to and scored by: ``marginal``, the likelihood of the levels that a flight
            shows; or ``filled``, weights that count as known after expectations were put where nothing was observed, as
            in the paper. The components of ``iterative`` have no likelihood, so that theirs are known.
        grid_top: Where the grid ends: ``shown``, the highest level that 20 and 2 % of the training flights reach, or
            a quarter where these are fewer; or ``quarter``, as in the paper.
        wind_error_mps: Standard error of the wind along the track by which airspeeds were derived, m/s: the spread that
            it adds is taken off. If absent, as flights show that report airspeeds too, else 2.5.
        temperature_error_k: That of the temperature, K.

    Example:
        >>> RepresentationSettings(explained_variance=0.9).cas_explained_variance
        0.95
    """

    explained_variance: OpenUnitInterval = 0.8
    cas_explained_variance: OpenUnitInterval = CAS_SHARE
    fpca: Method = "ppca"
    margin: PositiveFloat = MARGIN
    bounds: Bounds = "expected"
    residual: bool = True
    drag_scale: DragScaleName = "log"
    gaps: Gaps = "marginal"
    grid_top: Top = "shown"
    wind_error_mps: NonNegativeFloat | None = None
    temperature_error_k: NonNegativeFloat = TEMPERATURE_K


def fit_representation(
    train: Profiles,
    aircraft: PerformanceModel,
    split: Split,
    settings: RepresentationSettings = RepresentationSettings(),
    *,
    mass_kg: float | None = None,
    **known: Any,
) -> Representation:
    """Fit bases, scaler and bounds to training flights (paper, sections 2.2 to 2.4).

    Args:
        train: Training flights on their grid.
        aircraft: Coefficients that inferred their drag.
        split: The split that ``train`` comes from, to be recorded.
        settings: How.
        mass_kg: Mass that inferred the drag, if not the reference mass.
        **known: Parts that are not fitted: other arguments of :class:`~.representation.Representation`.

    Raises:
        DataError: If the flights do not vary or a level is observed by fewer than two of them.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> import polars as pl
        >>> train = profiles_from_frame(pl.read_parquet("descents.parquet"), aircraft("A320"), 150, 330)
        >>> parts = fit_representation(train, aircraft("A320"), Split(train.flight_ids, (), ()))
        >>> parts.decoder.encode(train).std(0).round(decimals=6).unique()  # standardised
        tensor([1.], dtype=torch.float64)
    """
    scale = fit_drag_scale(train, aircraft, settings.drag_scale)
    (drag, cas), mask = scale.observed(train)
    of_drag = fit_components(drag, mask, FL_M, settings.explained_variance, settings.fpca)
    of_cas = fit_components(cas, mask, FL_M, settings.cas_explained_variance, settings.fpca)
    if of_drag.n_components + of_cas.n_components == 0:
        raise DataError(
            "training flights that are all identical",
            expected="drag or CAS that varies between flights",
            mend="check that the rows come from different flights and are not copies",
        )
    decoder = standardised_decoder(train, aircraft, (of_drag, of_cas), scale, mass_kg)
    if settings.residual and settings.fpca == "ppca":
        decoder.residuals = fit_residuals(decoder, train)
    plausibility = Plausibility.from_profiles(train, settings.margin, settings.bounds, scale)
    gaps = settings.gaps if has_noise_model(decoder) else "filled"
    return Representation(decoder, plausibility, split, gaps=gaps, **{"provenance": {}, **known})


def standardised_decoder(
    train: Profiles,
    aircraft: PerformanceModel,
    bases: tuple[FunctionalBasis, FunctionalBasis],
    drag_scale: DragScale,
    mass_kg: float | None = None,
) -> DescentDecoder:
    """The decoder of which every weight has mean zero and variance one over the training flights.

    Args:
        train: Training flights on their grid.
        aircraft: Coefficients that inferred their drag.
        bases: Of drag and of CAS.
        drag_scale: Of the basis of drag.
        mass_kg: Mass that inferred the drag, if not the reference mass.

    Raises:
        DataError: If a weight is the same for every flight.

    Example:
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.densities.checkpoint import load_model
        >>> import polars as pl
        >>> known = load_model("best.ckpt").representation
        >>> train = encode_flights(pl.read_parquet("descents.parquet"), known)["train"].profiles
        >>> bases, scale = tuple(known.decoder.bases.values()), known.decoder.drag_scale
        >>> again = standardised_decoder(train, known.decoder.aircraft, bases, scale)
        >>> bool(torch.allclose(again.weight_scale, known.decoder.weight_scale))
        True
    """
    observed = drag_scale.observed(train)
    raw = torch.cat([basis.encode(one, observed.mask) for basis, one in zip(bases, observed.values, strict=True)], 1)
    scale = raw.std(0)
    if not bool((scale > 0).all()):
        raise DataError(
            "a component whose weight is the same for every training flight",
            expected="weights that vary between flights",
            mend="prepare more descents, or lower data.explained_variance or data.cas_explained_variance",
        )
    return DescentDecoder(aircraft, train.levels_fl, *bases, drag_scale, raw.mean(0), scale, mass_kg)


def fit_residuals(decoder: DescentDecoder, train: Profiles) -> Residuals:
    """The residual of training flights, by a decoder whose components are those of a probabilistic PCA.

    The curves are the directions of the probabilistic PCA beyond the kept components, made as large at each level as
    what flights show less their kept components. Where few flights show a level, as at the top, the model's are half as
    large again. The numbers of a flight are drawn given the levels that it shows, so that where it shows none they vary
    as those of all flights.

    Args:
        decoder: With the components kept.
        train: Training flights on its grid.

    Example:
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.densities.checkpoint import load_model
        >>> import polars as pl
        >>> known = load_model("best.ckpt").representation
        >>> train = encode_flights(pl.read_parquet("descents.parquet"), known)["train"].profiles
        >>> residuals = fit_residuals(known.decoder, train)
        >>> bool((residuals.drag.square().sum(0).sqrt() < train.drag_n[:, 0].std()).all())  # less than of the flights
        True
    """
    weights = decoder.encode(train)
    shown, generator = decoder.drag_scale.observed(train), torch.Generator().manual_seed(0)
    some = torch.arange(0, len(train), -(-len(train) // MOST_FLIGHTS))
    curves, numbers = [], []
    for basis, values, kept in zip(decoder.bases.values(), shown.values, decoder.scaled_profiles(weights), strict=True):
        left = torch.where(shown.mask, values - kept, 0.0)
        curves.append(_as_large_as_left(basis, left, shown.mask))
        numbers.append(_drawn_numbers(curves[-1], basis.noise_variance, left[some], shown.mask[some], generator))
    drag, speed = curves
    return Residuals(drag, speed, weights[some], torch.cat(numbers, 1), train.entry_level[some])


def _as_large_as_left(basis: FunctionalBasis, left: Tensor, mask: Tensor) -> Tensor:
    """Directions that a basis leaves out, as large as ``left`` (n, L) of what flights show.

    They carry the noise of the probabilistic PCA as well, for it is how flights vary from one stretch of levels to the
    next. So they are made larger by it at the most; smaller as flights show.
    """
    curves, count = basis.left_out().T, mask.sum(0).to(left)
    model = curves.square().sum(0)
    shown = left.square().sum(0) / count
    ratio = (torch.minimum(shown, model + basis.noise_variance) / model.clamp(min=1e-18)).sqrt()
    return (curves * (smoother(count, SPREAD_WEIGHT) @ ratio).clamp(min=0.0)).contiguous()


def _drawn_numbers(curves: Tensor, noise: Tensor, left: Tensor, mask: Tensor, generator: torch.Generator) -> Tensor:
    """Numbers (n, r) of curves (r, L), standard normal a priori, drawn given what flights show (n, L)."""
    groups = group_masks(mask)
    means, covariances, _ = posterior(left, groups, curves.T.contiguous(), noise)
    white = torch.randn(means.shape, generator=generator, dtype=means.dtype)
    roots = torch.linalg.cholesky(covariances)
    return means + torch.einsum("nij,nj->ni", roots[groups.group], white)
