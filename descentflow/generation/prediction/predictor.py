"""Predict the rest of a descent whose first part was observed."""

from contextlib import suppress
from copy import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from descentflow.core.counter_random import seed_for_name
from descentflow.core.errors import DataError, SamplingError
from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import NO_CONTEXT
from descentflow.generation._given_temperature import given_deviation_k, in_given_air
from descentflow.generation.conditional._latent_density import LatentDensities
from descentflow.generation.prediction.time_calibration import Control, TimeCalibration
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.encode_flights import EncodedFlights
from descentflow.representation.own_air import check_standard_air
from descentflow.representation.profiles import Profiles

CALIBRATION_FLIGHTS = 1000
"""Flights by which intervals are calibrated at most: a share of 90 % is then known to 0.9 %."""
CALIBRATION_CONTINUATIONS = 100
"""Of each flight there: what the ends of one interval are off by, other flights' make up for."""
NEAR_LEVELS = 5
"""Levels between the last observed level and that of the calibration, beyond which times stay as drawn."""
FEWEST_TO_CALIBRATE = 10
"""Flights without which nothing is calibrated."""
MIN_CONTINUATIONS = 50
"""Continuations that must descend all the way: a 90 % interval of fewer has its ends between the last few."""


@dataclass(frozen=True)
class Continuations:
    """Continuations of one descent, all equally probable.

    ``trajectories`` start at the last observed level, at time zero. ``effective`` of the draws are independent (all of
    them where the posterior is in closed form), and ``rejected`` did not descend all the way. ``noise_s`` (L,) is half
    the 90 % interval that reports add to the time at each level, in seconds; zero where nothing was calibrated.

    Example:
        >>> from descentflow.generation.prediction.predict import predict
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=50)
        >>> one = ahead.flights[0]
        >>> len(one.trajectories) + one.rejected, one.effective
        (50, 50.0)
    """

    flight_id: str
    trajectories: Trajectories
    effective: float
    rejected: int
    noise_s: Tensor


class DescentPredictor:
    """Conditions a density on the observed part of a descent.

    Drag and CAS on the observed levels are linear in the weights (paper, equation 4), so under a Gaussian or a mixture
    the posterior is in closed form; under a flow it is importance resampling from a mixture's. Each draw is decoded as
    a sample is, and left out if it does not descend all the way.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.representation.encode_flights import encode_flights
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> model = load_model("best.ckpt")
        >>> flights = encode_flights(read_descents("descents.parquet").frame, model.representation)["test"]
        >>> ahead = DescentPredictor(model).predict(flights.profiles.subset([0]), from_fl=250, n=100)
        >>> bool((ahead.trajectories.time_s[:, 0] > 0).all())  # s from FL250 to the lowest level
        True
    """

    def __init__(self, density: Density, seed: int = 0) -> None:
        """Prepare what all flights share.

        Args:
            density: A density with its representation.
            seed: Of the proposal mixture for a density without a closed form.
        """
        check_standard_air(density.representation, "a prediction of the rest of a descent")
        self.density, self.representation, self.seed = density, density.representation, seed
        self.latent = LatentDensities(density, seed)
        self.curves = self.latent.curves
        self.calibration: TimeCalibration | None = None
        self.control: Control | None = None

    def calibrated(self, from_fl: float, *parts: EncodedFlights, seed: int = 0) -> "DescentPredictor":
        """The predictor with times calibrated on flights (:mod:`~descentflow.generation.prediction.time_calibration`).

        Args:
            from_fl: The last level that will count as observed.
            parts: Flights that the density was fitted to, each continued by the others, and flights that validated it.
                Those are used (1,000 at most) whose levels from the last observed one down are all observed.
            seed: As in :meth:`predict`.

        Raises:
            DataError: If fewer than ten flights can be used.
        """
        calibrated = copy(self)
        calibrated.calibration = None
        last = int((self.representation.decoder.levels_fl < from_fl).sum())
        whole = [(part, i) for part in parts for i in range(len(part)) if bool(part.profiles.mask[i, : last + 1].all())]
        # Neighbours in a file were flown on one day, by one operator: those taken are spread over all of it.
        whole = whole[:: max(-(-len(whole) // CALIBRATION_FLIGHTS), 1)]
        drawn, observed, flown_s = [], [], []
        for part, i in whole:
            flight, calibrated.latent = part.subset([i]), self.latent
            if part is parts[0]:
                calibrated.latent = self.latent.without(flight.weights, len(part), flight.context)
            with suppress(SamplingError):
                ahead = calibrated.predict(
                    flight.profiles, from_fl, CALIBRATION_CONTINUATIONS, seed, context=flight.context
                )
                drawn.append(ahead.trajectories)
                observed.append(observed_at(flight.profiles, last))
                flown_s.append(flight.profiles.time_s[:, :last] - flight.profiles.time_s[:, last, None])
        if len(drawn) < FEWEST_TO_CALIBRATE:
            raise DataError(
                f"{len(drawn)} flights observed from FL{from_fl:.0f} to the bottom",
                expected="at least ten to calibrate with",
                mend="pass descents that hold more of the flights that the model was fitted to",
            )
        calibrated.latent = self.latent
        known, times = torch.cat(observed), torch.cat(flown_s).double()
        calibrated.calibration = TimeCalibration.of_flights(drawn, known, times)
        calibrated.control = Control.of_flights(known, times)
        return calibrated

    def predict(
        self, flight: Profiles, from_fl: float, n: int = 500, seed: int = 0, *, context: Tensor = NO_CONTEXT
    ) -> Continuations:
        """Continue one flight from a level down to the lowest of the grid.

        Args:
            flight: One flight on the decoder's grid; levels below ``from_fl`` are ignored.
            from_fl: The last level that counts as observed.
            n: Most continuations, 50 at least; those that do not descend all the way are left out of them.
            seed: Makes the result repeatable.
            context: (1, c) encoded context of the flight, for a conditional density.

        Raises:
            DataError: If the flight is not one, is on another grid, or shows no level at and above ``from_fl``.
            SamplingError: If fewer than 50 continuations descend all the way.
        """
        mask = self._observed(flight, from_fl)
        posterior = self.latent.after(replace(flight, mask=mask[None]), context)
        # With the same numbers for all, what the ends of one flight's interval are off by, all flights' would be.
        generator = torch.Generator().manual_seed(seed_for_name(seed, flight.flight_ids[0]))
        drawn, effective = posterior.draw(n, generator)
        entry = torch.full((n,), int(mask.nonzero()[0]))
        flown = self.representation.decoder.fly_scaled(self.curves.scaled_profiles(drawn), entry)
        # Not the sampler's bounds: an observed flight may lie outside what training flights did, and still goes on.
        good = flown.descends
        kept = int(good.sum())
        if kept < MIN_CONTINUATIONS:
            raise SamplingError(
                f"{kept or 'none'} of {n} continuations of {flight.flight_ids[0]} from FL{from_fl:.0f} "
                "descends all the way",
                expected=f"{MIN_CONTINUATIONS} at least, of a flight not unlike those trained on",
                mend="ask for more continuations, check the flight's rows, or train on flights like it",
            )
        flown = in_given_air(flown, given_deviation_k(self.representation, context).expand(len(flown)))
        flown, noise_s = flown.subset(good), torch.zeros(len(flown.levels_fl), dtype=torch.float64)
        if self.calibration is not None and abs(int(flown.entry[0]) - self.calibration.last) <= NEAR_LEVELS:
            flown, noise_s = self.calibration.applied(flown, observed_at(flight, int(flown.entry[0]))[0])
        return Continuations(flight.flight_ids[0], flown, effective, int((~good).sum()), noise_s)

    def _observed(self, flight: Profiles, from_fl: float) -> Tensor:
        levels = self.representation.decoder.levels_fl
        if len(flight) != 1 or not torch.equal(flight.levels_fl, levels):
            raise DataError(
                f"{len(flight)} flight(s) on FL{flight.levels_fl[0]:.0f}-{flight.levels_fl[-1]:.0f}",
                expected=f"one flight on the checkpoint's grid, FL{levels[0]:.0f}-{levels[-1]:.0f}",
                mend="take one flight, with the levels of the checkpoint",
            )
        mask = flight.mask[0] & (levels >= from_fl)
        if not bool(mask.any()):
            raise DataError(
                f"{flight.flight_ids[0]} has no level at and above FL{from_fl:.0f}",
                expected="at least one, with its speed and rate",
                mend="predict from a lower level",
            )
        return mask


def observed_at(flights: Profiles, level: int) -> Tensor:
    """CAS and rate (n, 2) of flights at a level of the grid, in m/s.

    Example:
        >>> from descentflow.aircraft_types.registry import aircraft
        >>> from descentflow.representation.profiles import profiles_from_frame
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> flights = profiles_from_frame(read_descents("descents.parquet").frame, aircraft("A320"), 150)
        >>> observed_at(flights, 50).shape
        torch.Size([120, 2])
    """
    return torch.stack([flights.cas_mps[:, level], flights.rate_mps[:, level]], 1).double()
