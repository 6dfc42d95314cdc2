"""Flights for the library traffic: a file that it reads, and a model as its generation, without importing it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from descentflow.core.errors import ConfigError
from descentflow.core.tabular import write_table
from descentflow.densities.checkpoint import as_density
from descentflow.exports.export_request import ExportRequest, rows_at
from descentflow.generation.sample import sample
from descentflow.generation.sample_columns import FUEL
from descentflow.positions.ground_plan import GroundPlan

Array = NDArray[np.float64]
FEATURES = ("track", "groundspeed", "altitude", "timedelta")
"""Columns that traffic needs to lay flights over the ground: degrees, kt, ft, s."""
KNOWN = (*FEATURES, "latitude", "longitude", "vertical_rate", "IAS", "Mach", "TAS")
LARGE, SMALL = ("groundspeed", "altitude", "timedelta", "IAS", "TAS"), 10.0
"""Features whose values are hundreds of their units, and what half of the values of a scaled one lie below."""
NAMES = {"altitude_ft": "altitude", "CAS": "IAS"}
"""Columns that traffic calls otherwise; its IAS is what our CAS is, for position errors are unknown."""
KEPT: tuple[str, ...] = ("timestamp", "flight_id", "callsign", "icao24", "typecode", "altitude", "latitude")
KEPT += ("longitude", "groundspeed", "track", "vertical_rate", "IAS", "Mach", "TAS", "distance_to_go_nm", *FUEL)


def flights(request: ExportRequest) -> pl.DataFrame:
    """One row for each flight and second (``step_s``) in traffic's names and units, in the order of time.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, end_time="2026-11-22T10:00:00")
        >>> flights(ExportRequest(load_model("best.ckpt"), Path("t.parquet"), n=2, plan=plan)).columns[:4]
        ['timestamp', 'flight_id', 'callsign', 'icao24']
    """
    flights = request.flights().rename(NAMES)
    return flights.select(name for name in KEPT if name in flights.columns)


def write(request: ExportRequest) -> list[Path]:
    """Write the flights.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0, end_time="2026-11-22T10:00:00")
        >>> write(ExportRequest(load_model("best.ckpt"), Path("t.parquet"), n=2, plan=plan))[0].name
        't.parquet'
    """
    write_table(flights(request), request.path)
    return [request.path]


class TrafficGeneration:
    """Draws descents as ``traffic.algorithms.generation.Generation`` expects them of a model.

    Its ``Generation(TrafficGeneration(...), features).sample(n)`` makes a ``Traffic``. A row of the matrix is a flight:
    ``n_obs`` times equally far apart from its entry level to the lowest, the features of each.

    Example:
        >>> from descentflow.positions.ground_plan import ground_plan
        >>> plan = ground_plan(end=(51.47, -0.45), track=270.0)
        >>> rows, labels = TrafficGeneration("best.ckpt", plan, n_obs=50).sample(10)
        >>> rows.shape, labels.shape
        ((10, 200), (10,))
    """

    def __init__(
        self, model: object, plan: GroundPlan, features: Sequence[str] = FEATURES, n_obs: int = 100, seed: int = 0
    ) -> None:
        """Take a fitted model.

        Args:
            model: A checkpoint's path, a density, or a fitted model.
            plan: Where the descents are flown; it must have a path.
            features: Some of :data:`KNOWN`, in the order that traffic gets too.
            n_obs: Times of each flight.
            seed: Of the first call of :meth:`sample`; every further call draws other flights.

        Raises:
            ConfigError: If a feature is not known, or the plan has no path.
        """
        odd = [name for name in features if name not in KNOWN]
        if odd or n_obs < 2:
            raise ConfigError(
                f"features {', '.join(odd) or 'at one time'}",
                expected=f"some of {', '.join(KNOWN)} at two times or more",
                mend="leave the others out",
            )
        if plan.path is None:
            raise ConfigError("a plan without a path", expected="an end point and a track, or a route", mend="give it")
        self.density, self.plan, self.features = as_density(model), plan, tuple(features)
        self.n_obs, self.seed = n_obs, seed

    def fit(self, X: Array, **settings: Any) -> "TrafficGeneration":
        """Take the number of times from traffic's matrix; the model has been fitted by descentflow.

        It cannot learn from these features: drag is inferred from airspeeds, which they do not have.

        Raises:
            ConfigError: If the matrix has another number of features, or a scaler of ``Generation`` scaled it: what
                is drawn is in the features' units, and the scaler would scale it back.
        """
        times, rest = divmod(np.asarray(X).shape[1], len(self.features))
        if rest or times < 2:
            raise ConfigError(
                f"{np.asarray(X).shape[1]} columns of {len(self.features)} features",
                expected="a multiple of the number of features",
                mend=f"prepare traffic with features={list(self.features)}",
            )
        grid = np.abs(np.asarray(X).reshape(len(X), times, -1))
        for k, name in enumerate(self.features):
            if name in LARGE and np.nanmedian(grid[:, :, k]) < SMALL:
                raise ConfigError(
                    f"{name} that was scaled, {np.nanmax(grid[:, :, k]):.3g} at most",
                    expected="features in their own units: nothing is learned of them that a scaler could help",
                    mend="make Generation without a scaler",
                )
        self.n_obs = times
        return self

    def sample(self, n_samples: int) -> tuple[Array, Array]:
        """Draw flights.

        Returns:
            (n_samples, n_obs * features), the features of the first time first; and a label for each, which is 0.
        """
        drawn = sample(self.density, n_samples, seed=self.seed)
        self.seed += 1
        vectors = []
        for descent in replace(drawn, plan=self.plan).to_polars().partition_by("sample_id", maintain_order=True):
            clock = descent["time_s"].to_numpy()
            rows = rows_at(descent, clock, np.linspace(0.0, clock[-1], self.n_obs)).rename(
                NAMES | {"time_s": "timedelta"}
            )
            vectors.append(rows.select(self.features).to_numpy().ravel())
        return np.stack(vectors), np.zeros(n_samples)
