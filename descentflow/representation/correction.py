"""Effects that a diagnosis found, applied to decoded descents: what `corrected.ckpt` adds to a simulator."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from descentflow.core.counter_random import FIRST_DRAWS, DrawNumbers
from descentflow.core.units import FL_M, KT_MPS
from descentflow.physics.airspeed import cas_to_mach, mach_to_tas_mps
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.decoder.trajectories import Trajectories, summed_from_entry
from descentflow.surveillance.cleaning.thresholds import Cleaning

if TYPE_CHECKING:
    from descentflow.effects.flight_state import FlightState


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
        flies, reports = self._changes(aircraft, altitude, flown.cas_mps, flown.mask, draws, flown.rate_mps)
        flies_mps, reports_mps = flies["cas"] * KT_MPS, reports["cas"] * KT_MPS
        mach = cas_to_mach(flown.cas_mps + flies_mps, altitude)
        factor = flies["rate"].exp()
        tas = mach_to_tas_mps(mach, altitude) * flies["tas"].exp()
        return replace(
            flown,
            time_s=_stretched(flown.time_s, flown.entry, 1 / factor),
            cas_mps=(flown.cas_mps + flies_mps + reports_mps).to(flown.cas_mps),
            mach=mach.to(flown.mach),
            tas_mps=tas.to(flown.tas_mps),
            rate_mps=(flown.rate_mps * factor * reports["rate"].exp()).to(flown.rate_mps),
        )

    def reach(self, aircraft: PerformanceModel, levels_fl: Tensor, cas_mps: Tensor) -> tuple[Tensor, Tensor]:
        """Change of CAS (n, L) in m/s and factor of the rate (n, L) at given speeds, of flights that effects take."""
        seen = torch.ones_like(cas_mps, dtype=torch.bool)
        flies, reports = self._changes(aircraft, levels_fl * FL_M, cas_mps, seen)
        return (flies["cas"] + reports["cas"]) * KT_MPS, (flies["rate"] + reports["rate"]).exp()

    def _changes(
        self,
        aircraft: PerformanceModel,
        altitude_m: Tensor,
        cas_mps: Tensor,
        mask: Tensor,
        draws: DrawNumbers | None = None,
        rate_mps: Tensor | None = None,
    ) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Changes that are flown and that are reported: of all flights, far out in what differs, without draws."""
        # Here and not above: a plain decoder must not pay for the catalogue.
        from descentflow.effects import EFFECTS
        from descentflow.effects.effects_together import changes_together

        theta = {name: torch.tensor(sizes, dtype=torch.float64) for name, sizes in self.effects.items()}
        state = self._state(aircraft, altitude_m, cas_mps, mask, rate_mps)
        flies, reports = changes_together(state, EFFECTS, theta, draws)
        if self.inherited:
            flies["rate"], reports["rate"] = (torch.zeros_like(state.cas_mps) for _ in range(2))
        return {**flies, "tas": flies["tas"] + self._air_of_training(state)}, reports

    def _state(
        self,
        aircraft: PerformanceModel,
        altitude_m: Tensor,
        cas_mps: Tensor,
        mask: Tensor,
        rate_mps: Tensor | None,
    ) -> "FlightState":
        """Decoded descents as effects look at them, each level a band."""
        from descentflow.effects.effects_together import slope_over_levels
        from descentflow.effects.flight_state import SLOWEST_MPS, FlightState

        cas, altitude = cas_mps.detach().double(), altitude_m.double()
        spacing = float(altitude[1] - altitude[0])
        top = torch.where(mask, altitude, -torch.inf).amax(1, keepdim=True)
        state = FlightState(
            aircraft,
            self.mass_kg,
            altitude,
            spacing,
            cas,
            slope_over_levels(cas, spacing),
            torch.zeros_like(cas),
            mask,
            (top - altitude).clamp(min=0.0),
            affected=False,
            cleaning=self.cleaning,
        )
        if rate_mps is None:
            return state
        # A held path takes the place of the very rate that was flown.
        own = (-rate_mps.detach().double()).clamp(min=SLOWEST_MPS).log() - state.schedule_log_rate
        return replace(state, beyond_polar=torch.where(mask, own, 0.0))

    def _air_of_training(self, state: "FlightState") -> Tensor:
        """Part of ln TAS (n, L) by the air of the training flights, to which effects' changes are added."""
        from descentflow.effects import EFFECTS

        shift = torch.zeros_like(state.cas_mps)
        for name, had in self.of_training.items():
            effect, own = EFFECTS[name], torch.tensor(had, dtype=torch.float64)
            added = torch.tensor(self.effects.get(name, [0.0] * len(had)), dtype=torch.float64)
            shift = shift + effect.shift(state, own + added)["tas"] - effect.shift(state, added)["tas"]
        return shift

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


def _stretched(time_s: Tensor, entry: Tensor, factor: Tensor) -> Tensor:
    """Times (n, L) whose legs are longer by the mean factor of their two ends; zero at entry."""
    legs = (time_s[:, :-1] - time_s[:, 1:]) * (0.5 * (factor[:, 1:] + factor[:, :-1])).to(time_s)
    return summed_from_entry(legs, entry)
