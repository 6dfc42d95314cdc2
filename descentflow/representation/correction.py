"""Effects that a diagnosis found, applied to decoded descents: what `corrected.ckpt` adds to a simulator."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from descentflow.core.counter_random import FIRST_DRAWS, DrawNumbers
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.surveillance.cleaning.thresholds import Cleaning

if TYPE_CHECKING:
    from descentflow.effects.flight_state import FlightState

SLOPE_LEVELS = 15
"""Levels over which the slope of a sampled CAS is taken on either side."""
LAWS = 1000
"""First stream of random numbers of effects that flights have each in their own way; those before belong to effects
that are alike in the flights that they take, by their place."""
MOST_OWN = 8
"""Random numbers of one such effect at most."""
FAR_OUT = 0.975
"""Quantile of what flights have of such an effect, to say how far it reaches: all but one in forty are within."""


@dataclass(frozen=True)
class Correction:
    """Effects by name with their parameters, and the mass at which their sensitivities are taken.

    Drag stays as the latent model drew it; speeds, rates and times change. What only sensors add (bias and lag) changes
    the reported speed and rate and not the time; noise has no mean and is not added. An effect that takes a share of
    the flights takes them whole and leaves the others as they are, each in its own way where flights differ (its own
    window, its own path); which ones and how is drawn by seed and number of the draw, so that it is the same in either
    precision, in any batch and on any device.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> decoder = model.representation.decoder
        >>> flown = decoder(model.sample(5, seed=0))
        >>> warmer = Correction({"temperature": [10.0]}, 57e3).apply(decoder.aircraft, flown)
        >>> bool((warmer.tas_mps > flown.tas_mps)[flown.mask].all())  # at the same Mach number
        True
    """

    effects: dict[str, list[float]]
    mass_kg: float
    inherited: bool = False
    """True if the simulator's own flights had the effects: its inferred drag then gives the right rates already."""
    cleaning: Cleaning = field(default_factory=Cleaning)
    """Settings with which the simulator's own flights were cleaned: they say where descents begin."""
    of_training: dict[str, list[float]] = field(default_factory=dict)
    """Effect -> its parameters in the air that the training flights flew in. Their rates, and so the drag that was
    inferred in standard air, hold it already; the TAS of the samples does not, and gets it here."""

    def apply(self, aircraft: PerformanceModel, flown: Trajectories, draws: DrawNumbers = FIRST_DRAWS) -> Trajectories:
        """The descents as they are with the effects.

        Args:
            aircraft: Coefficients of the type that flies.
            flown: n descents.
            draws: Seed and numbers of these draws, by which an effect takes its share of the flights.
        """
        altitude = (flown.levels_fl * FL_M).to(flown.cas_mps)
        flies, reports = self._shifts(aircraft, altitude, flown.cas_mps, flown.mask, draws, flown.rate_mps)
        cas = flown.cas_mps + flies["cas"] + reports["cas"]
        mach = cas_to_mach(flown.cas_mps + flies["cas"], altitude)
        factor = flies["rate"].exp()
        tas = mach_to_tas_mps(mach, altitude) * flies["tas"].exp()
        return replace(
            flown,
            time_s=_stretched(flown.time_s, flown.entry, 1 / factor),
            cas_mps=cas.to(flown.cas_mps),
            mach=mach.to(flown.mach),
            tas_mps=tas.to(flown.tas_mps),
            rate_mps=(flown.rate_mps * factor * reports["rate"].exp()).to(flown.rate_mps),
        )

    def reach(self, aircraft: PerformanceModel, levels_fl: Tensor, cas_mps: Tensor) -> tuple[Tensor, Tensor]:
        """Change of CAS (n, L) in m/s and factor of the rate (n, L) at given speeds, of flights that effects take."""
        altitude = levels_fl * FL_M
        flies, reports = self._shifts(aircraft, altitude, cas_mps, torch.ones_like(cas_mps, dtype=torch.bool))
        return flies["cas"] + reports["cas"], (flies["rate"] + reports["rate"]).exp()

    def _shifts(
        self,
        aircraft: PerformanceModel,
        altitude_m: Tensor,
        cas_mps: Tensor,
        mask: Tensor,
        draws: DrawNumbers | None = None,
        rate_mps: Tensor | None = None,
    ) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Sums of shifts that are flown, and that are reported only: ``rate`` (ln), ``cas`` (m/s), ``tas`` (ln)."""
        from descentflow.effects.flight_state import SLOWEST_MPS, log_rate

        state = _state(aircraft, self, altitude_m, cas_mps, mask)
        if rate_mps is not None:
            # A held path takes the place of the very rate that was flown.
            own = (-rate_mps.detach().double()).clamp(min=SLOWEST_MPS).log() - state.schedule_log_rate
            state = replace(state, beyond_polar=torch.where(mask, own, 0.0))
        flies, reports = self._sums(state, draws)
        if self.inherited:
            zero = torch.zeros_like(state.cas_mps)
            flies["rate"], reports["rate"] = zero, zero
        if bool((flies["cas"] != 0).any()):
            # At another speed the aircraft falls as the polar says.
            moved = log_rate(state, faster_mps=flies["cas"])
            flies["rate"] = flies["rate"] + moved - log_rate(state)
        return flies, reports

    def _sums(self, state: "FlightState", draws: DrawNumbers | None) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Changes by effects, flown and reported, in the flights that each of them takes (all without draws)."""
        # Here and not above: a plain decoder must not pay for the catalogue.
        from descentflow.effects import EFFECTS
        from descentflow.effects.flight_law import DiffersByFlight

        zero = torch.zeros_like(state.cas_mps)
        flies, reports = ({"rate": zero, "cas": zero, "tas": zero} for _ in range(2))
        held, rate_held, begun = torch.zeros_like(zero[:, :1], dtype=torch.bool), zero, 0.0
        for place, (name, sizes) in enumerate(self.effects.items()):
            effect, theta = EFFECTS[name], torch.tensor(sizes, dtype=torch.float64)
            share, whole = effect.mixture(theta)
            if isinstance(effect, DiffersByFlight) and effect.is_law(theta):
                # A flight has one effect of this kind or none: one number decides which.
                taken = _between(draws, zero, LAWS, begun, begun + share)
                begun += share
                change = effect.own_change(state, whole, _own_numbers(draws, zero, place, effect.own_draws))
                if effect.holds_rate:
                    # Whatever else would change the rate: it is held.
                    held, rate_held = held | taken, torch.where(taken, change.flown["rate"], rate_held)
                    continue
            else:
                taken = _between(draws, zero, place, 0.0, share)
                change = effect.change(state, whole)
            for total, shift in ((flies, change.flown), (reports, change.reported)):
                for quantity, value in shift.items():
                    # A decoder knows no wind, no gap and no noise.
                    if quantity not in total:
                        continue
                    own = torch.where(taken, value, 0.0)
                    total[quantity] = total[quantity] + own * (KT_MPS if quantity == "cas" else 1.0)
        tas = flies["tas"] + self._air_of_training(state)
        return {**flies, "rate": torch.where(held, rate_held, flies["rate"]), "tas": tas}, reports

    def _air_of_training(self, state: "FlightState") -> Tensor:
        """Part of ln TAS (n, L) by the air of the training flights, beside the effects' change of it."""
        from descentflow.effects import EFFECTS

        found = torch.zeros_like(state.cas_mps)
        for name, had in self.of_training.items():
            effect, own = EFFECTS[name], torch.tensor(had, dtype=torch.float64)
            added = torch.tensor(self.effects.get(name, [0.0] * len(had)), dtype=torch.float64)
            found = found + effect.shift(state, own + added)["tas"] - effect.shift(state, added)["tas"]
        return found

    def to_state(self) -> dict[str, Any]:
        """Primitives for a checkpoint."""
        return {
            "effects": dict(self.effects),
            "mass_kg": self.mass_kg,
            "inherited": self.inherited,
            "of_training": dict(self.of_training),
        }

    @classmethod
    def from_state(cls, state: dict[str, Any], cleaning: Cleaning | None = None) -> "Correction":
        """Rebuild from :meth:`to_state`.

        Args:
            state: As :meth:`to_state` gave it.
            cleaning: Settings with which the simulator's own flights were cleaned; the defaults if unknown.

        Raises:
            KeyError: If it names an effect that this version does not have, or a part is missing.
            TypeError: If a part is of another type.
            ValueError: If an effect has other parameters.
        """
        from descentflow.effects import EFFECTS

        strange = [name for name in state["effects"] if name not in EFFECTS]
        if strange:
            raise KeyError(f"effect {strange[0]}")
        effects, of_training = (
            {name: [float(v) for v in theta] for name, theta in state[part].items()}
            for part in ("effects", "of_training")
        )
        short = [name for name, theta in effects.items() if len(theta) != len(EFFECTS[name].parameters)]
        if short:
            raise ValueError(f"{len(effects[short[0]])} parameters of {short[0]}")
        given = cleaning or Cleaning()
        return cls(effects, float(state["mass_kg"]), bool(state["inherited"]), given, of_training)


def _state(
    aircraft: PerformanceModel, correction: Correction, altitude_m: Tensor, cas_mps: Tensor, mask: Tensor
) -> "FlightState":
    """Decoded descents as effects look at them, each level a band."""
    from descentflow.effects.flight_state import FlightState

    cas, altitude = cas_mps.detach().double(), altitude_m.double()
    spacing = float(altitude[1] - altitude[0])
    top = torch.where(mask, altitude, -torch.inf).amax(1, keepdim=True)
    depth = (top - altitude).clamp(min=0.0)
    slope, still = _slope(cas, spacing), torch.zeros_like(cas)
    return FlightState(
        aircraft,
        correction.mass_kg,
        altitude,
        spacing,
        cas,
        slope,
        still,
        mask,
        depth,
        affected=False,
        cleaning=correction.cleaning,
    )


def _between(draws: DrawNumbers | None, like: Tensor, stream: int, low: float, high: float) -> Tensor:
    """Flights (n, 1) whose number lies between two shares; all of them without draws, or where that is every one."""
    if draws is None or (low <= 0.0 and high >= 1.0):
        return torch.ones_like(like[:, :1], dtype=torch.bool)
    number = draws.uniform(len(like), stream=stream).to(like.device)
    return ((number >= low) & (number < high))[:, None]


def _own_numbers(draws: DrawNumbers | None, like: Tensor, place: int, count: int) -> Tensor:
    """Numbers (n, count) by which flights have an effect in their own way; far out in its law without draws."""
    if draws is None:
        return torch.full((len(like), count), FAR_OUT, dtype=like.dtype, device=like.device)
    streams = [LAWS + 1 + place * MOST_OWN + k for k in range(count)]
    return torch.stack([draws.uniform(len(like), stream) for stream in streams], 1).to(like.device)


def _slope(cas_mps: Tensor, spacing_m: float) -> Tensor:
    """dCAS/dHp over some levels on either side; CAS drawn from components is smooth already."""
    n = cas_mps.shape[1]
    index = torch.arange(n)
    low, high = (index - SLOPE_LEVELS).clamp(min=0), (index + SLOPE_LEVELS).clamp(max=n - 1)
    slope: Tensor = (cas_mps[:, high] - cas_mps[:, low]) / ((high - low) * spacing_m)
    return slope


def _stretched(time_s: Tensor, entry: Tensor, factor: Tensor) -> Tensor:
    """Times (n, L) whose legs are longer by the mean factor of their two ends; zero at entry."""
    legs = time_s.diff(dim=1) * (0.5 * (factor[:, 1:] + factor[:, :-1])).to(time_s)
    total = torch.nn.functional.pad(legs.cumsum(1), (1, 0))
    return total - total.gather(1, entry[:, None])
