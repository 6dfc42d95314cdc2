"""Result of sampling: plausible descents and the account of every draw behind them."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np
import polars as pl
import torch
from torch import Tensor

from descentflow.air.level_air import LevelAir
from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.version import __version__
from descentflow.densities.density import Density
from descentflow.generation.sample_tables import to_dataset, to_frame, write_samples
from descentflow.positions.ground_plan import NOWHERE, Ground, GroundPlan, ground_plan
from descentflow.positions.placing import Positions
from descentflow.reporting.in_notebook import WithTable
from descentflow.representation.decoder.trajectories import Trajectories

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class RejectionReport:
    """Account of every draw: kept, or rejected by which rule.

    A draw that breaks several rules counts under each of them, so ``broken`` may sum to more than ``rejected``.
    ``surplus`` draws were plausible but beyond the number asked for.

    Example:
        >>> report = RejectionReport(drawn=110, accepted=100, rejected=8, surplus=2, broken={"not_finite": 8})
        >>> print(report)
        100 samples from 110 draws (92.7% plausible, 2 of them more than asked for; broken: not_finite 8)
    """

    drawn: int
    accepted: int
    rejected: int
    surplus: int
    broken: dict[str, int]

    @property
    def acceptance(self) -> float:
        """Share of draws that were plausible."""
        return (self.accepted + self.surplus) / self.drawn if self.drawn else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Primitives for a JSON report."""
        return {**self.__dict__, "acceptance": self.acceptance}

    def __str__(self) -> str:
        """One line for a terminal."""
        reasons = ", ".join(f"{rule} {count}" for rule, count in self.broken.items() if count) or "none"
        samples, draws = _counted(self.accepted, "sample"), _counted(self.drawn, "draw")
        more = f", {self.surplus:,} of them more than asked for" if self.surplus else ""
        return f"{samples} from {draws} ({self.acceptance:.1%} plausible{more}; broken: {reasons})"


def _counted(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"


@dataclass(frozen=True, repr=False)
class Samples(WithTable):
    """n plausible descents, and the account of every draw behind them.

    Attributes:
        weights: (n, d) standardised weights.
        trajectories: The descents, each from its entry level down to the lowest level of the grid.
        report: What became of every draw.
        context: The contexts that they were drawn for, a row for each: sample i has row i, beginning again after the
            last. Without columns for a model without context.
        plan: Where they are flown; in still air and at no place unless :meth:`placed`.
        air: The air (n, L) of each; None for standard air.
        flown_at: Where each is, of those that were flown in a weather field along the plan's path.
        origin: Checkpoint, type, versions, seed and time, see :func:`origin_of`; Parquet and NetCDF keep it.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> samples = sample("best.ckpt", 100, seed=0)
        >>> samples.to_polars().columns
        ['sample_id', 'level_fl', 'time_s', 'altitude_ft', 'CAS', 'Mach', 'TAS', 'vertical_rate', 'drag_n', \
'thrust_n', 'fuel_flow_kg_s', 'fuel_kg', 'co2_kg', 'distance_nm', 'distance_to_go_nm', 'top_of_descent_nm', \
'groundspeed']
        >>> samples.to_xarray()["CAS"].dims
        ('sample', 'level')
        >>> samples.write("samples.nc")
    """

    weights: Tensor
    trajectories: Trajectories
    report: RejectionReport
    context: pl.DataFrame = field(default_factory=pl.DataFrame)
    plan: GroundPlan = NOWHERE
    air: LevelAir | None = None
    flown_at: Positions | None = None
    origin: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """Number of descents."""
        return len(self.trajectories)

    def placed(self, **ground: Unpack[Ground]) -> "Samples":
        """The same descents laid over the ground, see :func:`descentflow.positions.ground_plan.ground_plan`.

        Raises:
            ConfigError: If the arguments contradict each other, one of them cannot be, or the descents were flown in a
                weather field along a path of their own.
            DataError: If a file of winds cannot be read.

        Example:
            >>> from descentflow.generation.sample import sample
            >>> placed = sample("best.ckpt", 3, entry_fl=330).placed(end=(51.47, -0.45), track=270.0, wind="290/40")
            >>> placed.to_polars().columns[-3:]
            ['latitude', 'longitude', 'track']
        """
        if self.flown_at is not None:
            raise ConfigError(
                "another path for descents that were flown in a weather field along one",
                expected="the path in whose air they were flown",
                mend="sample along the other path",
            )
        return replace(self, plan=ground_plan(**ground))

    @cached_property
    def positions(self) -> Positions:
        """Distances, groundspeeds, and places where a path is known.

        Raises:
            ConfigError: If the wind is stronger than the airspeed.
            DataError: If a field of wind does not hold a place or a time.
        """
        if self.flown_at is not None:
            return self.flown_at
        return self.plan.place(self.trajectories, 0.0 if self.air is None else self.air.tailwind_mps)

    def to_polars(self) -> pl.DataFrame:
        """The long table: one row for each sample and level, see :func:`~.sample_tables.to_frame`."""
        return to_frame(self.trajectories, self.context, self.positions, self.air)

    def to_xarray(self) -> Any:
        """An `xarray.Dataset` with dimensions sample and level, NaN above a sample's entry level.

        Raises:
            ConfigError: If xarray is not installed.
        """
        return to_dataset(self.trajectories, self.context, self.positions, self.air).assign_attrs(self.origin)

    @checked_arguments
    def write(self, path: Output) -> None:
        """Write a table (``.parquet``, ``.csv``) or a NetCDF file (``.nc``), whole or not at all.

        Parquet has ``origin`` in its metadata, NetCDF in its attributes.

        Raises:
            ConfigError: If the extension is none of these.
            DataError: If the folder does not exist.
        """
        write_samples(self.trajectories, Path(path), self.context, self.positions, self.air, self.origin)

    @checked_arguments
    def figure(self, *, title: str = "") -> "Figure":
        """CAS, vertical rate and time left against flight level, see :func:`~.sample_figures.samples_figure`.

        Args:
            title: Written above; the number of samples if absent.

        Raises:
            DataError: If there is no sample.
        """
        from descentflow.generation.sample_figures import samples_figure

        return samples_figure(self.trajectories, title=title)

    def notebook_figure(self) -> "Figure | None":
        """:meth:`figure`; nothing without a sample."""
        return self.figure() if len(self) else None

    def __str__(self) -> str:
        """The account of the draws, the grid, and how long the descents take."""
        flown = self.trajectories
        levels = f"FL{flown.levels_fl[0]:.0f} to FL{flown.levels_fl[-1]:.0f}"
        fitted = f"\ndrawn from the fit to {self.origin['fitted_to']}" if "fitted_to" in self.origin else ""
        if not len(self):
            return f"{self.report}\nlevels {levels}{fitted}"
        entered = flown.levels_fl[flown.entry.cpu()].double().quantile(_ENDS)
        minutes = (flown.time_s[:, 0].detach().cpu() / 60).double().quantile(_ENDS)
        return (
            f"{self.report}\nlevels {levels}; entry FL{entered[1]:.0f} (FL{entered[0]:.0f} to FL{entered[2]:.0f}); "
            f"time to the lowest level {minutes[1]:.1f} min ({minutes[0]:.1f} to {minutes[2]:.1f}; median, 5 to 95 %)"
            f"{fitted}"
        )


_ENDS = torch.tensor([0.05, 0.5, 0.95], dtype=torch.float64)


@dataclass(frozen=True, repr=False)
class GeneratedSamples(Samples):
    """n descents that meet what was asked; all that :class:`Samples` does.

    Attributes:
        asked: What they meet, in words, with the level of every speed.
        first: Number of the first; the others follow.
        effective: (n,) effective proposals that each was chosen among, 1 for all where they are drawn in closed form.
        proposals: Proposals that each was chosen among, at least; 1 in closed form.

    Example:
        >>> import descentflow as df
        >>> one = df.Generator("best.ckpt", seed=1).next(entry_fl=330, cas_kt=(275, 285))
        >>> one.asked, one.proposals
        (('entry at FL330', 'cas_kt 275 to 285 at FL234'), 1)
    """

    asked: tuple[str, ...] = ()
    first: int = 0
    effective: np.ndarray = field(default_factory=lambda: np.ones(0))
    proposals: int = 1

    def __str__(self) -> str:
        """The samples, what was asked, and the effective proposals."""
        lines = [super().__str__(), "asked: " + ("; ".join(self.asked) or "nothing")]
        if self.proposals > 1:
            least, middle = float(self.effective.min()), float(np.median(self.effective))
            lines.append(
                f"each chosen among {self.proposals} proposals or more, {middle:.0f} of them effective (median; "
                f"{least:.0f} at least)"
                + "; under a Gaussian or a mixture clearances take 16 or one"
                * (self.proposals > 16)
            )
        return "\n".join(lines)


def origin_of(density: Density, seed: int) -> dict[str, str]:
    """Names and texts for the metadata of a file; the checkpoint is that which :func:`.checkpoint.load_model` read.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> origin_of(load_model("best.ckpt"), seed=3)
        {'source': 'descentflow ..., torch ...', 'model': 'GaussianDensity', 'typecode': 'A320', \
'fitted_to': '86 of 120 flights (...)', 'seed': '3', 'date_created': '...Z', 'checkpoint': 'best.ckpt', \
'checkpoint_sha256': '...'}
    """
    return {
        "source": f"descentflow {__version__}, torch {torch.__version__}",
        "model": type(density).__name__,
        "typecode": density.representation.decoder.aircraft.typecode,
        "fitted_to": density.representation.split.describe(),
        "seed": str(seed),
        "date_created": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        **density.file,
    }
