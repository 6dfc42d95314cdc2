"""Changes by injected effects in flight and in the instruments, flight by flight; neutral values change nothing."""

from dataclasses import dataclass, fields
from typing import Self

import torch
from torch import Tensor

EDGE_M = 90.0
"""Height over which brakes run out or a bank is rolled in: some 8 s of descent."""
REFERENCE_MACH = 0.6
"""Mach number at which the position error of IAS is its constant part."""


@dataclass(frozen=True)
class FlightRows:
    """Dataclass of tensors whose first dimension counts flights.

    Example:
        >>> len(neutral(3).rows(torch.tensor([0, 2])).noise_factor)
        2
    """

    def rows(self, index: Tensor) -> Self:
        """Return the flights of an index tensor."""
        return type(self)(**{field.name: getattr(self, field.name)[index] for field in fields(self)})


@dataclass(frozen=True)
class Injected(FlightRows):
    """Effects beyond the parameters that every flight has; all float64 of shape (n,).

    Example:
        >>> from dataclasses import replace
        >>> replace(neutral(3), rate_lag_s=torch.full((3,), 12.0, dtype=torch.float64)).rate_lag_s
        tensor([12., 12., 12.], dtype=torch.float64)
    """

    brake_gain: Tensor
    """Share by which brakes raise CD0 between two pressure altitudes; 0 for none."""
    brake_high_m: Tensor
    brake_low_m: Tensor
    wave_gain: Tensor
    """Share by which compressibility raises CD0 at ``wave_mach``; it grows with the square beyond ``wave_onset``."""
    wave_onset: Tensor
    wave_mach: Tensor
    kept_share: Tensor
    """Share of drag minus idle thrust that thrust keeps at the top of descent."""
    kept_s: Tensor
    """Time in which that decays."""
    power_share: Tensor
    """Share of drag minus idle thrust that thrust keeps in all of the idle descent."""
    ice_share: Tensor
    """The same between two pressure altitudes."""
    ice_high_m: Tensor
    ice_low_m: Tensor
    induced_gain: Tensor
    """Share by which CD2 is higher."""
    bank_rad: Tensor
    """Bank of a turn between two pressure altitudes."""
    turn_high_m: Tensor
    turn_low_m: Tensor
    hold_high_m: Tensor
    """Pressure altitudes between which a path or a vertical rate is held; NaN for none."""
    hold_low_m: Tensor
    hold_angle: Tensor
    """Geometric path angle held, radians, negative; NaN where a rate is held."""
    hold_rate_mps: Tensor
    """Rate of pressure altitude held; NaN where an angle is held."""
    cas_bias_mps: Tensor
    """Reported minus true CAS at :data:`REFERENCE_MACH`."""
    cas_bias_slope_mps: Tensor
    """Its growth for one Mach."""
    rate_lag_s: Tensor
    """Added to the time constant of the transponder's smoothing of vertical rate."""
    noise_factor: Tensor
    """Of the standard deviations of all reported fields."""

    def drag_gain(self, altitude_m: Tensor, mach: Tensor) -> Tensor:
        """Factor of CD0 at an altitude and a Mach number."""
        brakes = self.brake_gain * inside(altitude_m, self.brake_low_m, self.brake_high_m)
        beyond = (mach - self.wave_onset).clamp(min=0.0) / (self.wave_mach - self.wave_onset)
        return 1 + brakes + self.wave_gain * beyond * beyond

    def power(self, altitude_m: Tensor) -> Tensor:
        """Thrust above idle that is never taken back, in units of drag minus idle thrust."""
        return self.power_share + self.ice_share * inside(altitude_m, self.ice_low_m, self.ice_high_m)

    def bank(self, altitude_m: Tensor) -> Tensor:
        """Bank at an altitude, radians."""
        return self.bank_rad * inside(altitude_m, self.turn_low_m, self.turn_high_m)


def inside(altitude_m: Tensor, low_m: Tensor, high_m: Tensor) -> Tensor:
    """One between two altitudes, zero outside, and linear over :data:`EDGE_M` at both ends.

    Example:
        >>> inside(torch.tensor([8000.0, 7045.0, 6000.0]), torch.tensor(7000.0), torch.tensor(9000.0))
        tensor([1.0000, 0.5000, 0.0000])
    """
    return (((high_m - altitude_m) / EDGE_M).clamp(0.0, 1.0)) * (((altitude_m - low_m) / EDGE_M).clamp(0.0, 1.0))


def neutral(n: int) -> Injected:
    """Nothing injected on n flights.

    Example:
        >>> float(neutral(1).noise_factor)
        1.0
    """
    zero, missing = torch.zeros(n, dtype=torch.float64), torch.full((n,), torch.nan, dtype=torch.float64)
    values = {f.name: zero for f in fields(Injected)}
    values |= dict.fromkeys(("hold_high_m", "hold_low_m", "hold_angle", "hold_rate_mps"), missing)
    return Injected(**values | {"wave_mach": zero + 1, "kept_s": zero + 1, "noise_factor": zero + 1})
