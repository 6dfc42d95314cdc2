"""Noisier or coarser reports: more variance from level to level, and nothing else."""

import torch
from torch import Tensor

from descentflow.effects.effect import Effect, Parameter, Shift
from descentflow.effects.flight_state import FlightState

CHANNELS = {
    "rate": "the vertical rate",
    "cas": "IAS",
    "mach": "Mach",
    "tas": "TAS",
    "groundspeed": "groundspeed",
    "altitude": "altitude",
}
"""Channels whose short-scale noise is measured, with what readers call them."""


class MeasurementNoise(Effect):
    """Logarithm of the ratio of short-scale standard deviations, channel by channel.

    Example:
        >>> from descentflow.effects.example_flights import example_flights
        >>> noisier = MeasurementNoise()
        >>> shift = noisier.shift(example_flights(), torch.full((len(noisier.parameters),), 0.7))
        >>> round(float(shift["noise_cas"].exp().mean()), 2)  # twice the noise of IAS
        2.01
    """

    name = "measurement_noise"
    says = "noisier or coarser reports"
    parameters = tuple(
        Parameter(
            f"ln_ratio_{name}",
            -3.0,
            3.0,
            "1",
            0.1,
            label=f"ln of the ratio of the noise of {label}",
            shown_as="logarithm",
            symbol=f"noise of {label}",
        )
        for name, label in CHANNELS.items()
    )
    sensor = True
    is_noise = True

    def plausible(self, state: FlightState, theta: Tensor) -> bool:
        """Some airspeed is noisier by a tenth; less noise throughout is a smoother flight and no instrument.

        Rate and altitude alone do not make it: brakes, held rates and paths that begin and end raise theirs.
        """
        airspeeds = theta[1:4]
        return float(airspeeds.max()) > 0.1 and float(theta.max()) >= -float(theta.min())

    def shift(self, state: FlightState, theta: Tensor) -> Shift:
        """Noise of each channel."""
        each = torch.ones_like(state.cas_mps[:, 0])
        return {f"noise_{name}": theta[i] * each for i, name in enumerate(CHANNELS)}
