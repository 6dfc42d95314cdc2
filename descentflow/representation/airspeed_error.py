r"""Airspeeds that were derived from groundspeed, less the spread that the error of the weather field adds to them.

A field's wind errs by a few metres per second and its temperature by a kelvin: one part is common to the hours and the
region, one is alike over some 8,000 ft of a flight, a small one is white. The errors do not depend on how an aircraft
flies, and reported rates do not have them. So what they add is known: given
its rates a flight's CAS spreads with the covariance $\Sigma + G$ where aircraft spread with $\Sigma$, and $G$ follows
from the sizes. The flights' departures from what their rates lead to expect are mapped to $\Sigma$ by the linear map
that moves them least, :math:`B = \Sigma^{1/2} (\Sigma^{1/2} (\Sigma + G) \Sigma^{1/2})^{-1/2} \Sigma^{1/2}`, and drag
is inferred again of the CAS so found and the reported rates. A flight's own error is not known: its CAS is one that
flights have, and not the one that it had.

Source: Peyre and Cuturi, Computational Optimal Transport (2019), remark 2.31.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import polars as pl
import torch
from torch import Tensor

from descentflow.air.air_smoother import matern
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_tas_mps
from descentflow.physics.atmosphere import isa_temperature_k
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.fpca.gappy import gappy_profiles
from descentflow.representation.fpca.mask_groups import group_masks
from descentflow.representation.fpca.ppca import posterior
from descentflow.representation.profiles import Profiles, drag_at_idle_n
from descentflow.surveillance.rows.airspeed_source import REPORTED, derived_flights

WIND_MPS, TEMPERATURE_K = 2.5, 1.0
"""Standard errors of a field's wind along the track and of its temperature: ERA5's vectors err by 2 to 4.5 m/s."""
COMMON, OF_FLIGHT, WHITE = 0.25, 0.7, 0.05
"""Shares of their variance that are common to hours and region, alike over 8,000 ft of a flight, and white."""
FEWEST_DERIVED = 50
"""Derived flights below which nothing can be taken off: their spread is not known well enough."""
AT_LEVEL = 20
"""Of them at a level at least."""
OF_CAS, OF_RATE = 16, 6
"""Directions of CAS in which the spread is mapped, and of rates that it is expected from."""
LEAST_VARIANCE_LEFT = 0.02
"""Share of a direction's variance that is left at least: more error than there is spread was not there."""
QUIET_KT2, MOST_KT = 0.17, 40.0
"""Variance of a reported IAS by its rounding to 1 kt and that
of groundspeed, and the largest difference of both that counts."""
SLOWEST_MPS = -0.5
"""Rate whose logarithm is taken at least."""


@dataclass(frozen=True)
class AirspeedErrors:
    """Standard errors of the wind along the track and of the temperature, and the flights whose airspeeds have them.

    Attributes:
        wind_mps: Of the wind.
        temperature_k: Of the temperature.
        measured: Whether they were measured on flights that report airspeeds too; else published.
        flight_ids: Flights of which most levels are derived.
    """

    wind_mps: float
    temperature_k: float
    measured: bool
    flight_ids: frozenset[str]

    def covariance(self, cas_mps: Tensor, altitude_m: Tensor) -> Tensor:
        """Covariance (L, L) of CAS, (m/s)^2, about a profile of CAS (L,)."""
        parts = self.parts(cas_mps, altitude_m)
        alike = COMMON + OF_FLIGHT * matern(altitude_m, altitude_m) + WHITE * torch.eye(len(altitude_m))
        return sum((torch.outer(part, part) for part in parts), torch.zeros(())) * alike

    def parts(self, cas_mps: Tensor, altitude_m: Tensor) -> tuple[Tensor, Tensor]:
        """Errors of CAS by that of the wind and by that of the temperature, of the shape of both arguments."""
        tas = cas_to_tas_mps(cas_mps, altitude_m)
        step = 2 / (cas_to_tas_mps(cas_mps + 1.0, altitude_m) - cas_to_tas_mps(cas_mps - 1.0, altitude_m))
        return self.wind_mps * step, self.temperature_k * step * tas / (2 * isa_temperature_k(altitude_m))

    @classmethod
    def of(
        cls, frame: pl.DataFrame, wind_mps: float | None = None, temperature_k: float = TEMPERATURE_K
    ) -> "AirspeedErrors | None":
        """The errors of prepared descents; None where no airspeed is derived.

        Args:
            frame: Prepared descents.
            wind_mps: If known; else as flights that report airspeeds show, or published.
            temperature_k: Of the temperature.

        Example:
            >>> frame = pl.read_parquet("descents.parquet").with_columns(airspeed_source=pl.lit("field"))
            >>> errors = AirspeedErrors.of(frame)
            >>> errors.wind_mps, errors.measured, len(errors.flight_ids)
            (2.5, False, 120)
        """
        flights = frozenset(derived_flights(frame))
        if not flights:
            return None
        shown = None if wind_mps is not None else _measured_wind_mps(frame, temperature_k)
        size = next(size for size in (wind_mps, shown, WIND_MPS) if size is not None)
        return cls(size, temperature_k, shown is not None, flights)

    def __str__(self) -> str:
        """One line for a fit."""
        origin = "by flights that report airspeeds" if self.measured else "published, or as given"
        return (
            f"airspeeds of {len(self.flight_ids):,} flights are derived: the spread of CAS that a wind error of "
            f"{self.wind_mps:.1f} m/s along the track and {self.temperature_k:g} K add ({origin}) is taken off"
        )


def _measured_wind_mps(frame: pl.DataFrame, temperature_k: float) -> float | None:
    """Error of the wind by which derived CAS differs from reported IAS, where enough flights have both."""
    if "derived_IAS" not in frame.columns:
        return None
    both = frame.filter(pl.col("airspeed_source") == REPORTED).drop_nulls(["IAS", "derived_IAS"])
    if both["flight_id"].n_unique() < FEWEST_DERIVED:
        return None
    cas, level = (torch.from_numpy(both[name].cast(pl.Float64).to_numpy().copy()) for name in ("IAS", "level_fl"))
    left = both.select((pl.col("derived_IAS") - pl.col("IAS")).clip(-MOST_KT, MOST_KT)).to_series().to_numpy()
    unit = AirspeedErrors(1.0, temperature_k, True, frozenset())
    of_wind, of_temperature = (float(part.square().mean()) for part in unit.parts(cas * KT_MPS, level * FL_M))
    spread = (float((left**2).mean()) - QUIET_KT2) * KT_MPS**2 - of_temperature
    return float((max(spread, 0.0) / of_wind) ** 0.5)


def without_airspeed_error(
    profiles: Profiles,
    aircraft: PerformanceModel,
    errors: AirspeedErrors,
    chosen: Iterable[int],
    say: Callable[[str], None],
    mass_kg: float | None = None,
) -> Profiles:
    """Flights whose CAS spreads as that of aircraft, and no longer as the field's error adds to it, and its drag.

    Args:
        profiles: Flights whose drag was inferred in standard air.
        aircraft: Coefficients that inferred it.
        errors: Of the derived flights; others stay as they are.
        chosen: Positions of the flights by which spreads are judged: those of training.
        say: Called with a line on what was done.
        mass_kg: Mass that inferred the drag; the reference mass if absent.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> frame = pl.read_parquet("descents.parquet").with_columns(airspeed_source=pl.lit("field"))
        >>> profiles = profiles_from_frame(frame, aircraft("A320"), bottom_fl=150, top_fl=330)
        >>> errors = AirspeedErrors.of(frame, wind_mps=1.0, temperature_k=0.0)
        >>> less = without_airspeed_error(profiles, aircraft("A320"), errors, range(120), print)
        airspeeds of 120 flights are derived: ...
        >>> bool(less.cas_mps[:, 50].std() < profiles.cas_mps[:, 50].std())
        True
    """
    derived = torch.tensor([flight in errors.flight_ids for flight in profiles.flight_ids])
    judges = torch.zeros(len(derived), dtype=torch.bool).index_fill(0, torch.as_tensor(list(chosen)), True) & derived
    shown = profiles.mask[judges].sum(0) >= AT_LEVEL
    if int(judges.sum()) < FEWEST_DERIVED or not shown.any():
        say(f"airspeeds of {int(derived.sum())} flights are derived: too few to take the error of their field off")
        return profiles
    say(str(errors))
    mask, cas = profiles.mask[:, shown], profiles.cas_mps[:, shown].double()
    usable = mask.any(1) & derived
    rate = profiles.rate_mps[:, shown].clamp(max=SLOWEST_MPS).neg().log().double()
    modes, of_cas, mean = _directions(cas[usable], mask[usable], OF_CAS)
    _, of_rate, _ = _directions(rate[usable], mask[usable], OF_RATE)
    fitted, design = judges[usable], torch.cat([torch.ones_like(of_rate[:, :1]), of_rate], 1)
    lines = torch.linalg.lstsq(design[fitted], of_cas[fitted]).solution
    left = of_cas - design @ lines
    spread = left[fitted].T @ left[fitted] / (int(fitted.sum()) - design.shape[1])
    added = modes.T @ errors.covariance(mean, profiles.altitude_m[shown]) @ modes
    moved = torch.zeros_like(profiles.cas_mps)
    part = torch.zeros_like(cas)
    part[usable] = left @ (_to_less(spread, added) - torch.eye(len(added))) @ modes.T
    moved[:, shown] = torch.where(mask, part, 0.0).to(moved)
    cas_mps = profiles.cas_mps + moved
    drag_n = drag_at_idle_n(aircraft, cas_mps, profiles.rate_mps, profiles.altitude_m, mass_kg)
    return replace(profiles, cas_mps=cas_mps, drag_n=torch.where(profiles.mask, drag_n, 0.0))


def _directions(values: Tensor, mask: Tensor, q: int) -> tuple[Tensor, Tensor, Tensor]:
    """Orthonormal directions (L, q) of profiles, their coordinates (n, q), gaps expected, and the mean (L,)."""
    flights = gappy_profiles(torch.where(mask, values, 0.0), mask)
    model = flights.model(min(q, len(values) - 1, values.shape[1] - 1))
    centred = torch.where(mask, flights.values - model.shift, 0.0)
    latent, _, _ = posterior(centred, group_masks(mask), model.loadings, model.noise_variance)
    modes = torch.linalg.svd(model.loadings, full_matrices=False).U
    whole = torch.where(mask, centred, latent @ model.loadings.T)
    return modes, flights.scale * whole @ modes, flights.mean + flights.scale * model.shift


def _to_less(spread: Tensor, added: Tensor) -> Tensor:
    """The symmetric map of normal numbers of one covariance to those of the covariance without what was added."""
    values, vectors = torch.linalg.eigh(spread)
    root, back = (vectors * values.clamp(min=1e-12).sqrt() @ vectors.T for vectors, values in
                  ((vectors, values), (vectors, 1 / values.clamp(min=1e-12))))  # fmt: skip
    # In units of the spread one less the added variance is left, and never nothing.
    shares, axes = torch.linalg.eigh(back @ (spread - added) @ back)
    less = root @ (axes * shares.clamp(min=LEAST_VARIANCE_LEFT) @ axes.T) @ root
    values, vectors = torch.linalg.eigh(root @ less @ root)
    middle = vectors * values.clamp(min=1e-12).sqrt() @ vectors.T
    moved: Tensor = back @ middle @ back
    return moved
