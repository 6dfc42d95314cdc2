"""Detectors of changes by other programs, on the rates of flights day by day: when they alarm, and the day they name.

Each sees the rate alone, which is where the streams change; the watch shares its false alarms among four quantities.
Values are in standard deviations of the reference's flights. Settings are the libraries' own.
"""

from collections.abc import Callable, Sequence

import numpy as np
import ruptures
from numpy.typing import NDArray
from river.drift import ADWIN, PageHinkley
from scipy.stats import ks_2samp

Numbers = NDArray[np.float64]
Found = dict[str, int | None]
A_YEAR = 0.05 / 365
"""Level of each day's test for one false alarm in twenty years, by Bonferroni."""
NOTHING: Found = {"alarm": None, "date": None}


def adwin(days: Sequence[Numbers], reference: int) -> Found:
    """ADWIN (Bifet and Gavalda 2007), flight by flight; the change is where its window begins after the cut."""
    detector, seen = ADWIN(), 0
    for day, rates in enumerate(_standard(days, reference)):
        for value in rates:
            detector.update(float(value))
            seen += 1
            if detector.drift_detected and day >= reference:
                return {"alarm": day, "date": _day_of(days, seen - int(detector.width))}
    return NOTHING


def page_hinkley(days: Sequence[Numbers], reference: int) -> Found:
    """Test of Page and Hinkley, flight by flight; it names no day of change."""
    detector = PageHinkley()
    for day, rates in enumerate(_standard(days, reference)):
        for value in rates:
            detector.update(float(value))
            if detector.drift_detected and day >= reference:
                return {"alarm": day, "date": None}
    return NOTHING


def kolmogorov_smirnov(days: Sequence[Numbers], reference: int) -> Found:
    """Each day's flights against all of the reference, as if flights were independent; the day is that of the alarm."""
    known = np.concatenate(days[:reference])
    for day in range(reference, len(days)):
        if ks_2samp(days[day], known).pvalue < A_YEAR:
            return {"alarm": day, "date": day}
    return NOTHING


def offline(days: Sequence[Numbers], reference: int) -> Found:
    """PELT (Killick 2012) on all days' means at the end, with the penalty of Yao (1988); it raises no alarm earlier."""
    means = np.array([float(np.nanmean(day)) for day in days])
    penalty = 2.0 * np.log(len(means)) * float(means[:reference].var(ddof=1))
    cuts = ruptures.Pelt(model="l2", min_size=2, jump=1).fit(means).predict(pen=penalty)[:-1]
    later = [int(cut) for cut in cuts if cut >= reference]
    return {"alarm": len(days) - 1, "date": later[0]} if later else NOTHING


def _standard(days: Sequence[Numbers], reference: int) -> list[Numbers]:
    """Values by mean and standard deviation of the reference's flights, without those that show no rate."""
    known = np.concatenate(days[:reference])
    middle, spread = float(np.nanmean(known)), float(np.nanstd(known))
    return [(day[np.isfinite(day)] - middle) / spread for day in days]


def _day_of(days: Sequence[Numbers], flight: int) -> int:
    ends = np.cumsum([int(np.isfinite(day).sum()) for day in days])
    return int(np.searchsorted(ends, flight, side="right"))


RIVALS: dict[str, Callable[[Sequence[Numbers], int], Found]] = {
    "ADWIN": adwin,
    "Page-Hinkley": page_hinkley,
    "daily KS": kolmogorov_smirnov,
    "PELT": offline,
}
