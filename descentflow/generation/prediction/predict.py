"""Predict the rest of observed descents: what `descentflow predict-descent` calls."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import polars as pl

from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.errors import ConfigError, DataError, SamplingError
from descentflow.core.tabular import to_dataset, write_table
from descentflow.core.threads import one_thread_where_they_spin
from descentflow.densities.checkpoint import as_density
from descentflow.generation.prediction.predictor import MIN_CONTINUATIONS, NEAR_LEVELS, Continuations, DescentPredictor
from descentflow.generation.prediction.summary import (
    actual_times,
    continuations_table,
    control_intervals,
    coverage,
    time_intervals,
)
from descentflow.generation.prediction.time_calibration import Control
from descentflow.generation.sample_columns import COLUMNS
from descentflow.positions.ground_plan import NOWHERE, Ground, GroundPlan, ground_plan
from descentflow.reporting.in_notebook import WithTable
from descentflow.representation.encode_flights import EncodedFlights, encode_flights, tell_other_types
from descentflow.representation.profiles import Profiles
from descentflow.surveillance.open_descents import FlightSource

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, repr=False)
class Prediction(WithTable):
    """Predicted descents: intervals of the time to each level, and what was left out.

    Attributes:
        flights: Continuations of each flight that could be predicted.
        observed: The flights, also below the last observed level.
        from_fl: Last flight level that counted as observed.
        calibration: What the intervals were calibrated on, or why they were not.
        reasons: Why each of the other flights could not be predicted.
        fitted_to: Which flights the density was fitted to that predicted them.
        plan: Where they are flown; in still air and at no place unless :meth:`placed`.
        n_seen: Flights that were left out because the model was trained or validated on them.
        control: Least squares on CAS and rate at ``from_fl``, fitted to the flights of the calibration.

    Example:
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=100)
        >>> ahead.to_polars().columns[:8]
        ['flight_id', 'level_fl', 'mean_s', 'q05_s', 'q25_s', 'q50_s', 'q75_s', 'q95_s']
        >>> ahead.coverage().columns[:5]
        ['level_fl', 'flights', 'covered', 'width_s', 'rms_s']
    """

    flights: tuple[Continuations, ...]
    observed: Profiles
    from_fl: float
    calibration: str
    reasons: tuple[str, ...]
    fitted_to: str
    plan: GroundPlan = NOWHERE
    n_seen: int = 0
    control: Control | None = None

    def __len__(self) -> int:
        """Number of flights predicted."""
        return len(self.flights)

    def placed(self, **ground: Unpack[Ground]) -> "Prediction":
        """The same predictions laid over the ground, see :func:`descentflow.positions.ground_plan.ground_plan`.

        Example:
            >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=250, n=60)
            >>> ahead.placed(end=(51.47, -0.45), track=270.0, wind="290/40").to_polars().columns[-3:]
            ['latitude', 'longitude', 'track']
        """
        return replace(self, plan=ground_plan(**ground))

    @property
    def _level(self) -> int:
        """Index of the level that is last observed."""
        return int((self.observed.levels_fl < self.from_fl).sum())

    @cached_property
    def _intervals(self) -> pl.DataFrame:
        return time_intervals(self.flights, self.plan)

    def to_polars(self) -> pl.DataFrame:
        """Intervals of time and distance: a row for each flight and level, see :func:`~.summary.time_intervals`."""
        return self._intervals

    def to_xarray(self) -> Any:
        """Time intervals as an `xarray.Dataset` over flight and level, NaN at and above the last observed level.

        Raises:
            ConfigError: If xarray is not installed.
        """
        names = self._intervals.columns[2:]
        known = {**{name: column.unit for name, column in COLUMNS.items()}, "continuations": "1"}
        units = {name: known.get(name) or {"s": "s", "nm": "NM"}[name.rpartition("_")[2]] for name in names}
        return to_dataset(self._intervals, ("flight_id", "level_fl"), names, units)

    def continuations(self) -> pl.DataFrame:
        """Every continuation in the columns of samples, see :func:`~.summary.continuations_table`."""
        return continuations_table(self.flights, self.plan)

    def coverage(self) -> pl.DataFrame:
        """Errors of the forecasts by level, and of least squares on CAS and rate as a control.

        Only flights that were observed at every level below ``from_fl`` are counted; there may be none.

        Returns:
            Columns ``level_fl flights covered width_s rms_s``, see :func:`~.summary.coverage`, and the same of the
            control with names that end in ``_control`` where times were calibrated.
        """
        actual = actual_times(self.flights, self.observed)
        errors = coverage(self._intervals, actual)
        if self.control is None:
            return errors
        control = coverage(control_intervals(self.flights, self.observed, self.control), actual)
        return errors.join(control, on="level_fl", how="left", suffix="_control")

    @checked_arguments
    def write(self, path: Output) -> None:
        """Write the intervals as Parquet or CSV, whole or not at all.

        Raises:
            ConfigError: If the extension is neither ``.parquet`` nor ``.csv``.
            DataError: If the folder does not exist.
        """
        write_table(self._intervals, path)

    def figure(self) -> "Figure":
        """Figure of the prediction and of what was flown, see :func:`~.predicted_profiles.prediction_figure`."""
        from descentflow.generation.prediction.predicted_profiles import prediction_figure

        return prediction_figure(self.flights, self.observed, self.from_fl)

    notebook_figure = figure

    def __str__(self) -> str:
        """Calibration, counts, the first reasons, and how often the intervals held the time observed."""
        lines = [f"predicted by the fit to {self.fitted_to}", self.calibration]
        lines += [
            f"{len(self)} flights predicted from FL{self.from_fl:.0f}, {len(self.reasons)} not"
            + f"; {self.n_seen} left out: the checkpoint was trained or validated on them" * bool(self.n_seen)
        ]
        fewest = min(len(ahead.trajectories) for ahead in self.flights)
        lines += [f"intervals rest on {fewest} continuations or more"]
        aside = sum(abs(int(ahead.trajectories.entry[0]) - self._level) > NEAR_LEVELS for ahead in self.flights)
        if self.control is not None and aside:
            lines += [f"times of {aside} last observed above FL{self.from_fl + NEAR_LEVELS:.0f} are not calibrated"]
        lines += [f"  {reason}" for reason in sorted(set(self.reasons))[:3]]
        compared = self.coverage()
        if not compared.is_empty():
            lowest = compared.row(0, named=True)
            at = f"FL{lowest['level_fl']}"
            lines.append(
                f"90 % intervals hold {compared['covered'].to_numpy().mean():.0%} of the times observed (mean over "
                f"levels), {lowest['covered']:.0%} of {lowest['flights']} at {at}"
            )
            lines.append(f"at {at} they are {lowest['width_s']:.1f} s wide, RMSE {lowest['rms_s']:.1f} s")
            if lowest.get("rms_s_control") is not None:
                control = f"{lowest['width_s_control']:.1f} s, RMSE {lowest['rms_s_control']:.1f} s"
                lines[-1] += f"; least squares on CAS and rate alone {control}"
        return "\n".join(lines)


@checked_arguments
@one_thread_where_they_spin()
def predict(
    model: object,
    descents: object,
    from_fl: float,
    *,
    n: int = 500,
    seed: int = 0,
    flights: Sequence[str] | None = None,
    context_table: str | Path | pl.DataFrame | None = None,
    progress: Callable[[int], None] | None = None,
    total: Callable[[int], None] | None = None,
) -> Prediction:
    """Predict the rest of descents from their part at and above a flight level.

    Flights that are new to the model are predicted by its final fit, if it has one. If there are none, its held-out
    fit predicts those that it held out for test. Times are calibrated on the flights that the fit knows, each by the
    others, where the descents hold at least ten of them.

    Args:
        model: A checkpoint's path, a density, or a fitted model.
        descents: Path of rows or of prepared descents, or descents in memory. Flights that the model was trained or
            validated on are not predicted.
        from_fl: Last flight level that counts as observed.
        n: Continuations of each flight, 50 at least.
        seed: The same seed gives the same predictions.
        flights: Identifiers of the flights to predict; every unseen flight if absent.
        context_table: Table, or path of one, with ``flight_id`` and the context, for a conditional model.
        progress: Progress callback: called with 1 after each flight.
        total: Progress callback: called once, before the first flight, with the number of flights.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If ``n`` is below 50, a flight is not among the unseen ones, or the context does not fit.
        DataError: If the descents cannot be read, or no flight can be predicted.

    Example:
        >>> ahead = predict("best.ckpt", "descents.parquet", from_fl=290, n=100)
        >>> print(ahead)
        predicted by the fit to 86 of 120 flights (10 for validation and 24 for test held out)
        times calibrated on 72 flights of the fit, each by the others
        21 flights predicted from FL290, 3 not; 96 left out: the checkpoint was trained or validated on them
        intervals rest on ... continuations or more
        ...
    """
    if n < MIN_CONTINUATIONS:
        raise ConfigError(
            f"{n} continuations",
            expected=f"{MIN_CONTINUATIONS} at least: a 90 % interval of fewer has its ends between the last few",
            mend="ask for more, for instance 500; each is as probable as the others, so any few of them will do",
        )
    density = as_density(model).held_out_fit
    representation = density.representation
    bottom, top = (float(representation.decoder.levels_fl[place]) for place in (0, -1))
    if not bottom < from_fl <= top:
        raise ConfigError(
            f"FL{from_fl:g} as the last observed level",
            expected=f"a level above FL{bottom:.0f} and up to FL{top:.0f}, the model's grid",
            mend="pass one of these",
        )
    frame = FlightSource(descents).for_model(representation.cleaning, bottom).frame
    tell_other_types(frame, representation)
    parts, fit = encode_flights(frame, representation, context_table), density
    if (final := as_density(model)) is not density:
        new = encode_flights(frame, final.representation, context_table)
        if any(not flights or name in flights for name in new["test"].profiles.flight_ids):
            parts, fit = new, final
    predictor, calibration = _calibrated(DescentPredictor(fit, seed), from_fl, parts["train"], parts["validation"])
    chosen = _chosen(parts["test"], flights)
    if total is not None:
        total(len(chosen))
    predicted, reasons = [], []
    for i in range(len(chosen)):
        flight = chosen.subset([i])
        try:
            predicted.append(predictor.predict(flight.profiles, from_fl, n, seed, context=flight.context))
        except (DataError, SamplingError) as error:
            reasons.append(str(error))
        if progress is not None:
            progress(1)
    if not predicted:
        raise DataError(
            f"no flight of {len(chosen)} can be predicted; the first: {reasons[0] if reasons else 'none given'}",
            expected=f"flights with levels at and above FL{from_fl:.0f}",
            mend="predict from another level, or other flights",
        )
    seen = 0 if chosen is not parts["test"] else len(parts["train"]) + len(parts["validation"])
    fitted_to = predictor.representation.split.describe()
    return Prediction(
        tuple(predicted),
        chosen.profiles,
        from_fl,
        calibration,
        tuple(reasons),
        fitted_to,
        n_seen=seen,
        control=predictor.control,
    )


def _calibrated(predictor: DescentPredictor, from_fl: float, *parts: EncodedFlights) -> tuple[DescentPredictor, str]:
    """The predictor calibrated on the flights of its fit where there are enough, and what was done."""
    try:
        calibrated = predictor.calibrated(from_fl, *parts, seed=predictor.seed)
    except DataError as error:
        return predictor, f"not calibrated, intervals are likely to be too narrow: {error}"
    assert calibrated.calibration is not None
    return calibrated, f"times calibrated on {calibrated.calibration.n_flights} flights of the fit, each by the others"


def _chosen(held_out: EncodedFlights, names: Sequence[str] | None) -> EncodedFlights:
    if names is None or len(names) == 0:
        return held_out
    flight_ids = held_out.profiles.flight_ids
    position = {name: i for i, name in enumerate(flight_ids)}
    unknown = [name for name in names if name not in position]
    if unknown:
        raise ConfigError(
            f"flight {', '.join(unknown)}",
            expected="flights among the descents that the checkpoint was not trained or validated on",
            mend=f"choose from {', '.join(flight_ids[:3])}, ...",
        )
    return held_out.subset([position[name] for name in names])
