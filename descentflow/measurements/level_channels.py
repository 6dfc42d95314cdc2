"""Channels of flights on every level of the grid, and sums over bands of levels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.core.mode_s_steps import STEPS
from descentflow.core.units import FL_M, FPM_MPS, FT_M

STENCIL = 5
"""Levels on either side whose mean is compared with the level between: noise is shorter, flight is longer."""
MIN_STENCILS = 15
"""Whole stencils that a flight must show for its noise to be measured."""
QUIET_SHARE = 0.8
"""Share of the stencils that say the noise, those that leave least: where speed or rate change at once (from Mach
number to CAS, at the tropopause) a step of the flight is left, and no noise."""
OF_QUIET = 0.4377
"""Mean square of the least 80 % of normal values, in the mean square of all: 1 - 2 z phi(z) / 0.8 with z = 1.2816."""
LEAST_NOISE = 0.5
"""Of a report's step: less noise cannot be separated from rounding."""
NAMED = {"rate": "vertical_rate", "cas": "IAS", "mach": "Mach", "tas": "TAS", "groundspeed": "groundspeed"}
"""Name of a noise -> the channel that has it; that of the altitude is in the times at which levels are crossed."""
KINK = 1e-4
"""Second difference, in a report's step or in seconds, from which a row of the report lies within a level."""
LEAST_LAG = 0.5
"""Rows within half a stencil of which noise is measured at least: of fewer, nearly all of it is interpolated away."""
SHORT_GAP_LEVELS = 30
"""A level-off and the turns onto and off it take at most 3,000 ft out of a descent; a managed stretch mostly more."""
LOST_S = 15.0
"""Time lost in a gap from which it counts as one."""
MIN_IN_BAND = 0.4
"""Share of a band's levels that a flight must show there."""
EDGE_LEVELS = 3
"""Levels on either side of the edge of a band whose mean counts as the value there."""
MIN_AT_EDGE = 3
"""Least number of these levels."""


@dataclass(frozen=True)
class LevelGrid:
    """n flights on L ascending levels: ``values`` (n, L) by channel in field units, NaN where not seen.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = LevelGrid.of_frame(read_descents("descents.parquet").frame, 150, 340, ["IAS", "vertical_rate"])
        >>> grid.values["IAS"].shape, bool((grid.altitude_m.diff() > 0).all())
        (torch.Size([120, 191]), True)
    """

    levels_fl: Tensor
    time_s: Tensor
    values: dict[str, Tensor]
    airframe: Tensor
    flight_ids: tuple[str, ...]
    day: Tensor | None = None
    """(n,) number of the day (UTC) on which each flight began; unknown where absent."""

    @property
    def altitude_m(self) -> Tensor:
        """(L,) pressure altitude."""
        return self.levels_fl * FL_M

    @property
    def mask(self) -> Tensor:
        """(n, L) levels that were seen."""
        return self.time_s.isfinite()

    def legs(self) -> "Legs":
        """Legs from each level that a flight shows to the next that it shows below."""
        number = torch.arange(self.mask.shape[1]).expand(self.mask.shape)
        seen = torch.where(self.mask, number, -1).cummax(1).values
        previous = torch.nn.functional.pad(seen[:, :-1], (1, 0), value=-1)
        there, below = self.mask & (previous >= 0), previous.clamp(min=0)
        elapsed_s = torch.where(there, self.time_s.gather(1, below) - self.time_s, 0.0)
        return Legs(there, below, number - previous, elapsed_s)

    @classmethod
    def of_frame(
        cls, frame: pl.DataFrame, low_fl: float, high_fl: float, channels: Sequence[str]
    ) -> "LevelGrid | None":
        """Scatter a prepared table; None if nothing of it is on the grid."""
        placed = frame.filter(pl.col("level_fl").is_between(low_fl, high_fl)).drop_nulls(
            ["IAS", "vertical_rate", "time_s"]
        )
        if placed.is_empty():
            return None
        names = placed["flight_id"].unique().sort()
        row = pl.DataFrame({"flight_id": names, "_row": np.arange(len(names))})
        placed = placed.join(row, on="flight_id")
        levels = torch.arange(int(low_fl), int(high_fl) + 1, dtype=torch.float64)
        where = (placed["_row"].to_numpy(), placed["level_fl"].to_numpy() - int(low_fl))

        def grid(name: str) -> Tensor:
            full = np.full((len(names), len(levels)), np.nan)
            full[where] = placed[name].cast(pl.Float64).to_numpy()
            return torch.from_numpy(full)

        flights = placed.group_by("_row").agg(pl.col("icao24").first(), pl.col("timestamp").min()).sort("_row")
        owner = flights["icao24"].fill_null("").to_numpy().astype(str)
        codes = torch.from_numpy(np.unique(owner, return_inverse=True)[1].astype(np.int64))
        day = torch.from_numpy(flights["timestamp"].dt.epoch("d").to_numpy().astype(np.int64))
        filled = [c for c in channels if placed[c].drop_nulls().len() > 0]
        return cls(levels, grid("time_s"), {c: grid(c) for c in filled}, codes, tuple(names), day)

    def bands(self, height_fl: float) -> "Bands":
        """Bands of this height from the lowest level up; what is left at the top joins no band."""
        low, high = float(self.levels_fl[0]), float(self.levels_fl[-1])
        count = max(round((high - low) / height_fl), 1)
        middle = low + height_fl * (torch.arange(count, dtype=torch.float64) + 0.5)
        away = (self.levels_fl[:, None] - middle).abs()
        return Bands(self, middle * FL_M, (away <= height_fl / 2).double(), (away <= height_fl).double(), height_fl)


@dataclass(frozen=True)
class Legs:
    """Legs of flights on levels, (n, L) each: ``there`` is true at an upper end, ``below`` has the place of the lower.

    Example:
        >>> times = torch.tensor([[30.0, torch.nan, 8.0, 0.0]])
        >>> legs = LevelGrid(torch.arange(150.0, 154.0), times, {}, torch.zeros(1), ("one",)).legs()
        >>> legs.steps[legs.there], legs.elapsed_s[legs.there], legs.mean(times)[legs.there]
        (tensor([2, 1]), tensor([22.,  8.]), tensor([19.,  4.]))
    """

    there: Tensor
    below: Tensor
    steps: Tensor
    """Levels from one end to the other."""
    elapsed_s: Tensor
    """Zero where there is none."""

    def mean(self, values: Tensor) -> Tensor:
        """Mean (n, L) of the values at both ends."""
        means: Tensor = (values + values.gather(1, self.below)) / 2
        return means


@dataclass(frozen=True)
class Bands:
    """Sums over bands: ``inside`` (L, K) levels of each band, ``around`` (L, K) the same with half a band more.

    Example:
        >>> levels = torch.arange(150.0, 181.0).double()
        >>> grid = LevelGrid(levels, -levels[None], {"IAS": levels[None]}, torch.zeros(1), ("one",))
        >>> grid.bands(15.0).mean(grid.values["IAS"])
        tensor([[157.5000, 172.5000]], dtype=torch.float64)
    """

    grid: LevelGrid
    altitude_m: Tensor
    inside: Tensor
    around: Tensor
    height_fl: float

    def mean(self, values: Tensor) -> Tensor:
        """Mean (n, K) of values (n, L) over the seen levels of each band; NaN where too few are."""
        seen = values.isfinite().double()
        count = seen @ self.inside
        total = values.nan_to_num(0.0) @ self.inside
        return torch.where(count >= MIN_IN_BAND * self.inside.sum(0), total / count.clamp(min=1), torch.nan)

    def slope(self, values: Tensor) -> Tensor:
        """Slope (n, K) per metre of the line through the values in and around each band; zero where unknown."""
        seen = values.isfinite().double()
        height = self.grid.altitude_m - self.grid.altitude_m.mean()
        filled = values.nan_to_num(0.0)
        n, x, v = seen @ self.around, (seen * height) @ self.around, filled @ self.around
        xx, xv = (seen * height**2) @ self.around, (filled * height) @ self.around
        spread = xx - x * x / n.clamp(min=1)
        return torch.where(n >= 5, (xv - x * v / n.clamp(min=1)) / spread.clamp(min=1e-6), 0.0)

    def change(self, values: Tensor, fewest: int = MIN_AT_EDGE) -> Tensor:
        """Value (n, K) at the upper edge of each band minus that at its lower edge; NaN where either is not seen.

        Args:
            values: (n, L).
            fewest: Levels at an edge for it to be seen.
        """
        half = self.height_fl / 2
        middle = self.altitude_m / FL_M
        edges = torch.cat([middle[:1] - half, middle + half])
        near = ((self.grid.levels_fl[:, None] - edges).abs() <= EDGE_LEVELS).double()
        seen = values.isfinite().double() @ near
        at_edge = values.nan_to_num(0.0) @ near / seen.clamp(min=1)
        return torch.where(seen >= fewest, at_edge, torch.nan).diff(dim=1)

    def rates_mps(self, fall_mps: Tensor) -> tuple[Tensor, Tensor]:
        """Rate of descent (n, K) as reported, and from the times at levels; both as means over time.

        Height over time is the mean of the rate over time whatever the rate does within a band, so the two differ by
        what the report adds alone. Steps across gaps do not count.

        Args:
            fall_mps: (n, L) reported rate, positive in descent.
        """
        time_s = self.grid.time_s
        step = time_s[:, :-1] - time_s[:, 1:]
        reported = (fall_mps[:, :-1] + fall_mps[:, 1:]) / 2
        seen = step.isfinite() & (step > 0) & reported.isfinite()
        pairs = self.inside[:-1] * self.inside[1:]
        count = seen.double() @ pairs
        elapsed = torch.where(seen, step, 0.0) @ pairs
        fallen = torch.where(seen, reported * step, 0.0) @ pairs
        enough = count >= MIN_IN_BAND * pairs.sum(0)
        by_report = torch.where(enough, fallen / elapsed.clamp(min=1e-3), torch.nan)
        return by_report.clamp(min=0.5), torch.where(enough, count * FL_M / elapsed.clamp(min=1e-3), torch.nan)

    def depth_m(self) -> Tensor:
        """Height (n, K) of each flight's highest level above each band's middle."""
        n_levels = self.grid.mask.shape[1]
        top = n_levels - 1 - self.grid.mask.flip(1).to(torch.int8).argmax(1)
        return (self.grid.altitude_m[top][:, None] - self.altitude_m).clamp(min=0.0)


def short_scale_noise(grid: LevelGrid) -> dict[str, Tensor]:
    """Logarithm (n,) of the noise of one report of each channel, as far as the mean of the levels around shows it.

    Of the quietest 80 % of a flight's levels, so that steps of the flight itself do not count. Levels are interpolated
    between rows: what rows that are far apart lose by it is made up for (:func:`kept_of_noise`), so that equal noise is
    equal however fast a flight descends. Less than the rounding of a report counts as that: a simulator that writes
    numbers without noise differs from flights by their noise, and not by the number of digits.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = LevelGrid.of_frame(read_descents("descents.parquet").frame, 150, 340, ["IAS", "vertical_rate"])
        >>> round(float(short_scale_noise(grid)["noise_cas"].nanmedian().exp()), 1)  # kt
        0.5
    """
    series = {name: grid.values[channel] for name, channel in NAMED.items() if channel in grid.values}
    # The noise of an altitude is that of the time at which it is crossed, times the rate.
    rate_mps = -grid.values["vertical_rate"].nanmedian(1, keepdim=True).values / 60.0 * FT_M
    series["altitude"] = grid.time_s * rate_mps.clamp(min=1.0)
    if grid.mask.shape[1] <= 2 * STENCIL:  # no level has a whole stencil around it
        return {f"noise_{name}": torch.full(grid.mask.shape[:1], torch.nan, dtype=torch.double) for name in series}
    # Every level of the stencil must be there, or a level-off in a gap would pass for noise.
    whole = grid.mask.double().unfold(1, 2 * STENCIL + 1, 1).amin(-1) > 0
    kept, by_channel = kept_of_noise(grid), {}
    for name, values in series.items():
        rounding = least_noise(name)
        middle = values[:, STENCIL:-STENCIL]
        left = middle - (values[:, : -2 * STENCIL] + values[:, 2 * STENCIL :]) / 2
        seen = whole & left.isfinite()
        count = seen.sum(1)
        ordered = torch.where(seen, left.square(), torch.inf).sort(1).values
        quiet = (QUIET_SHARE * count).ceil().long().clamp(min=1)
        ordered = torch.where(torch.arange(ordered.shape[1]) < quiet[:, None], ordered, 0.0).nan_to_num(posinf=0.0)
        mean_square = ordered.sum(1) / quiet / OF_QUIET / kept
        noise = 0.5 * mean_square.clamp(min=max(rounding, 1e-9) ** 2).log()
        # A checkpoint keeps single precision: the least of one side must be the least of the other.
        by_channel[f"noise_{name}"] = torch.where(count >= MIN_STENCILS, noise.float().double(), torch.nan)
    return by_channel


def least_noise(name: str) -> float:
    """Noise that exceeds rounding: half a report's step; metres for the altitude.

    Rounding of a number that changes steadily is not independent from report to report, and may show as so much.

    Example:
        >>> round(least_noise("rate"), 1), round(least_noise("cas"), 1)  # ft/min and kt
        (16.0, 0.5)
    """
    return LEAST_NOISE * STEPS[NAMED.get(name, name)] * (FT_M if name == "altitude" else 1.0)


def kept_of_noise(grid: LevelGrid) -> Tensor:
    """Share (n,) of the variance of one report's noise that a stencil shows, one where rows are close.

    Interpolated noise is alike over a distance of two rows. With C the autocovariance of linear interpolation between
    independent values (the cubic B-spline) and x half a stencil in rows, the middle minus the mean of both ends has the
    variance 3/2 C(0) + C(2x)/2 - 2 C(x), which is one from x = 2 on. Rows show as bends: between two of them, all
    channels and the time are straight lines.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = LevelGrid.of_frame(read_descents("descents.parquet").frame, 150, 340, ["IAS", "vertical_rate"])
        >>> round(float(kept_of_noise(grid).median()), 2)  # a row every few seconds
        1.0
    """
    steps = {"time_s": 1.0, **{name: STEPS[name] for name in grid.values if name in STEPS}}
    bent = torch.zeros_like(grid.mask[:, 1:-1])
    for name, step in steps.items():
        values = grid.time_s if name == "time_s" else grid.values[name]
        bend = values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2]
        bent |= (bend.abs() > KINK * step) & bend.isfinite()
    whole = grid.mask.double().unfold(1, 3, 1).amin(-1) > 0
    share = (bent & whole).sum(1) / whole.sum(1).clamp(min=1)
    # A row within a level bends the line at the levels on either side of it.
    lag = (STENCIL * share / 2).clamp(min=LEAST_LAG)
    return 1.5 * _alike(torch.zeros_like(lag)) + _alike(2 * lag) / 2 - 2 * _alike(lag)


def _alike(lag: Tensor) -> Tensor:
    """Autocovariance of linear interpolation between independent values of variance one, by the lag in rows."""
    near = 2 / 3 - lag.square() + lag**3 / 2
    return torch.where(lag < 1, near, (2 - lag).clamp(min=0.0) ** 3 / 6)


def lost_in_jumps(grid: LevelGrid) -> tuple[Tensor, Tensor, Tensor]:
    """Legs (n, L) over levels that are missing, how many are, and the time lost there beyond that of the descent.

    Example:
        >>> falls = {"vertical_rate": torch.full((1, 3), -600.0)}  # 100 ft in 10 s
        >>> times = torch.tensor([[50.0, torch.nan, 0.0]])
        >>> lost_in_jumps(LevelGrid(torch.arange(150.0, 153.0), times, falls, torch.zeros(1), ("one",)))[2].round()
        tensor([[ 0.,  0., 30.]])
    """
    legs = grid.legs()
    jump = legs.there & (legs.steps > 1)
    typical = legs.mean(-grid.values["vertical_rate"] * FPM_MPS).nan_to_num(10.0).clamp(min=2.0)
    lost = torch.where(jump, legs.elapsed_s - legs.steps * FL_M / typical, 0.0)
    return jump, torch.where(jump, legs.steps - 1, 0).double(), lost


def gaps_of(grid: LevelGrid) -> dict[str, Tensor]:
    """Time lost and levels missing (n,) in the gaps of each flight, short gaps of altitude apart from longer ones.

    Example:
        >>> from descentflow.surveillance.descents.prepared_descents import read_descents
        >>> grid = LevelGrid.of_frame(read_descents("descents.parquet").frame, 150, 340, ["IAS", "vertical_rate"])
        >>> gaps = gaps_of(grid)
        >>> sorted(gaps), len(gaps["level"])
        (['level', 'level_gaps', 'missing', 'slow'], 120)
    """
    mask, jump, missing, lost = grid.mask, *lost_in_jumps(grid)
    counts = lost > LOST_S
    short = counts & (missing <= SHORT_GAP_LEVELS)
    longer = jump & ~short & ~((lost < LOST_S) & (missing <= 5))
    ends = (torch.where(mask, torch.arange(mask.shape[1]), -1).amax(1), mask.to(torch.int8).argmax(1))
    span = mask.any(1) * (ends[0] - ends[1] + 1).clamp(min=1)
    return {
        "level": torch.where(short, lost, 0.0).sum(1).clamp(max=900.0),
        "level_gaps": short.sum(1).double(),
        "slow": torch.where(longer, lost.clamp(-60.0, 900.0), 0.0).sum(1),
        "missing": torch.where(longer, missing, 0.0).sum(1) / span,
    }
