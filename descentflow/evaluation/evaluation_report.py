"""Result of an evaluation: scores with their noise floor, rejections, level flight of all sides, and figures."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isnan

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from descentflow.core.arguments import Output, checked_arguments
from descentflow.core.files import check_folder, write_whole
from descentflow.core.tabular import write_table
from descentflow.core.units import FPM_MPS
from descentflow.evaluation.figures._score_figures import acceptance_figure, classifier_figure, level_scores_figure
from descentflow.evaluation.figures.components import components_figure
from descentflow.evaluation.figures.level_cuts import cuts_figure
from descentflow.evaluation.figures.profile_bands import profiles_figure
from descentflow.evaluation.metrics.classifier import MIN_PAIRS, Detection, detect
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_registry import FUEL, level_parts
from descentflow.evaluation.metrics.score_table import ScoreTable
from descentflow.generation.samples import RejectionReport
from descentflow.reporting.figure_file import image
from descentflow.reporting.in_notebook import WithTable
from descentflow.representation.representation import Representation
from descentflow.surveillance.cleaning.level_flight import note_level_flight, side_by_side, stretches
from descentflow.surveillance.figure_pages import level_flight_figure
from descentflow.surveillance.rows.drop_report import DropReport


def sampled_level_flight(samples: DescentSet) -> Mapping[str, int]:
    """Notes of level flight in samples, as `prepare` has them of rows: their levels stand for reports.

    Example:
        >>> from descentflow.generation.sample import sample
        >>> samples = DescentSet.of_trajectories(sample("best.ckpt", 50).trajectories)
        >>> list(sampled_level_flight(samples).values())  # they descend freely
        [50, 50]
    """
    rows, levels = np.nonzero(samples.mask.numpy())
    report = DropReport()
    table = pl.DataFrame(
        {
            "flight_id": rows,
            "timestamp": pl.Series(1e6 * samples.time_s.numpy()[rows, levels]).cast(pl.Datetime("us")),
            "altitude": 100 * samples.levels_fl.numpy()[levels],
            "vertical_rate": samples.rate_mps.numpy()[rows, levels] / FPM_MPS,
        }
    )
    note_level_flight(stretches(table, gap_s=float("inf")), report)
    return report.notes


def in_words(sides: pl.DataFrame) -> list[str]:
    """A line for each set of flights; none where flights were not counted.

    Args:
        sides: Of :func:`~descentflow.surveillance.cleaning.level_flight.side_by_side`.

    Example:
        >>> from descentflow.surveillance.cleaning.level_flight import CONTINUOUS, FLIGHTS, IN_BAND, side_by_side
        >>> in_words(side_by_side({"flights": {FLIGHTS: 4, CONTINUOUS: 1, f"{IN_BAND}050": 200}}))
        ['level flight in descents of flights (4): 25 % have none, 50 s in the mean']
    """
    by_side = sides.group_by("side", "flights", "continuous", maintain_order=True).agg(pl.col("level_s").sum())
    return [
        f"level flight in descents of {name} ({n:,}): {100 * share:.0f} % have none, {seconds:.0f} s in the mean"
        for name, n, share, seconds in by_side.iter_rows()
    ]


FILES = ("scores.csv", "classifier.csv", "rejections.json", "level_flight.csv")
"""Files that are written besides figures."""
FEW_FLIGHTS = 100
"""Held-out flights with fewer of which the words come first."""
DPI = 110
"""Of the figures as files, and in TensorBoard."""


@dataclass(frozen=True, repr=False)
class Evaluation(WithTable):
    """Samples compared with held-out flights: their scores, and the draws that were rejected.

    Attributes:
        name: The model's name in figures.
        samples: Sampled descents.
        real: Held-out flights.
        nominal: The one nominal BADA descent.
        scores: Every statistic of every quantity, with its noise floor.
        rejections: What became of every draw.
        representation: The model's.
        n_seen: Flights that were left out because the model was trained or validated on them; None if not known.
        notes: Other reasons why flights were left out.
        level_flight: Of :func:`~descentflow.surveillance.cleaning.level_flight.side_by_side`: all flights that were
            given, samples, and a simulator; empty where flights were not counted.

    Example:
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> evaluation = evaluate("best.ckpt", "descents.parquet", n=500)
        >>> evaluation.scores.get("cas_below_transition", "wasserstein").unit
        'kt'
        >>> evaluation.to_polars().columns[:4]
        ['quantity', 'statistic', 'unit', 'score']
        >>> evaluation.write("evaluation", figures=False)
        >>> sorted(path.name for path in Path("evaluation").iterdir())
        ['classifier.csv', 'level_flight.csv', 'rejections.json', 'scores.csv']
    """

    name: str
    samples: DescentSet
    real: DescentSet
    nominal: DescentSet
    scores: ScoreTable
    rejections: RejectionReport
    representation: Representation
    n_seen: int | None = None
    notes: tuple[str, ...] = ()
    level_flight: pl.DataFrame = field(default_factory=lambda: side_by_side({}))

    @cached_property
    def classifier(self) -> Detection:
        """AUC of a classifier of samples and flights, and the quantities that it uses."""
        return detect(self.samples, self.real)

    def figures(self) -> dict[str, Figure]:
        """Figures by name: samples against flights (paper, figures 4-6), distances, rejections, components, and more.

        The classifier is left out where there are too few flights to judge, level flight where it was not counted.
        """
        decoder = self.representation.decoder
        of_classifier = {"classifier": classifier_figure(self.classifier)} if self.classifier.importance else {}
        return {
            "profiles": self.notebook_figure(),
            "cuts": cuts_figure(self.real, {self.name: self.samples}, self.nominal, self._cut_fl()),
            "distance_by_level": level_scores_figure(self.scores, decoder.transition_fl),
            "rejections": acceptance_figure(self.rejections),
            "components": components_figure(
                decoder.drag_basis, decoder.cas_basis, decoder.levels_fl, decoder.drag_scale
            ),
            **of_classifier,
            **({} if self.level_flight.is_empty() else {"level_flight": level_flight_figure(self.level_flight)}),
        }

    def notebook_figure(self) -> Figure:
        """Samples against flights (paper, figures 4-6)."""
        title = self.representation.decoder.aircraft.typecode
        return profiles_figure(self.real, {self.name: self.samples}, self.nominal, title=title)

    @cached_property
    def pictures(self) -> dict[str, bytes]:
        """The figures as PNG, by name: drawn once, for the files and for TensorBoard."""
        return {name: image(figure, dpi=DPI) for name, figure in self.figures().items()}

    def _cut_fl(self) -> float:
        """The transition, as in the paper's figures 8 and 9; the middle of the grid where the grid has none."""
        levels, transition = self.real.levels_fl, self.representation.decoder.transition_fl
        inside = float(levels[0]) < transition < float(levels[-1])
        return transition if inside else float(levels[len(levels) // 2])

    def to_polars(self) -> pl.DataFrame:
        """The scores: a row for each quantity and statistic, see :class:`~.metrics.score_table.Score`."""
        return self.scores.frame()

    @checked_arguments
    def write(self, folder: Output, *, figures: bool = True) -> None:
        """Write tables (:data:`FILES`) and, unless they are not wanted, figures as PNG."""
        folder = check_folder(folder, *FILES)
        folder.mkdir(parents=True, exist_ok=True)
        write_table(self.scores.frame(), folder / "scores.csv")
        write_table(pl.DataFrame(self.classifier.importance, schema=_IMPORTANCE), folder / "classifier.csv")
        write_table(self.level_flight, folder / "level_flight.csv")
        write_whole(folder / "rejections.json", json.dumps(self.rejections.as_dict(), indent=1))
        for name, picture in self.pictures.items() if figures else ():
            write_whole(folder / f"{name}.png", picture)

    def __str__(self) -> str:
        """Flights, what was left out, rejections, scores, what the classifier looks at, and a verdict in words."""
        seen = self.n_seen
        left_out = "" if seen is None else f" ({seen} left out: the checkpoint was trained or validated on them)"
        head = [f"{len(self.real)} held-out flights{left_out}", *self.notes]
        lines = [str(self.rejections), str(self.scores)]
        lines += [str(self.classifier)] if self.classifier.importance else []
        lines += in_words(self.level_flight)
        words = self.in_words
        # Of few flights most of the table is absent, so that the words come first.
        return "\n".join([*head, words, *lines] if len(self.real) < FEW_FLIGHTS else [*head, *lines, words])

    @property
    def in_words(self) -> str:
        """Verdict in words, with the reasons."""
        return f"In words: {verdict(self.scores, self.classifier)}."


_IMPORTANCE = {"quantity": pl.String, "low_fl": pl.Float64, "high_fl": pl.Float64, "loss": pl.Float64}


STATISTIC = "wasserstein"
"""Distance by which a quantity is judged."""
PASSING_AUC = 0.6
"""AUC up to which samples pass for flights: six of ten guesses are right."""


def verdict(scores: ScoreTable, detection: Detection) -> str:
    """Verdict: uses for which samples are good enough, and why.

    A quantity is near the flights if its distance at matched size is below the 95th percentile of the noise floor.

    Args:
        scores: With noise floors.
        detection: The classifier's.

    Example:
        >>> from torch import nan, tensor
        >>> from descentflow.evaluation.metrics.score_table import Score
        >>> near = Score("cas_below_transition", "wasserstein", "kt", equal_size=2.5, floor_high=3.5, n_each=40)
        >>> far = Score("rocd_below_transition", "wasserstein", "ft/min", equal_size=20.0, floor=10.0, floor_high=14.0)
        >>> print(verdict(ScoreTable((near, far)), Detection(tensor([nan]), ())))
        good enough for the distribution of CAS below: as near to held-out flights as other flights are;
        not for the distribution of rate below: 2.0 noise floors off;
        too few held-out flights to judge the course of single descents
    """
    names = {name: part.short for name, part in level_parts().items()} | {FUEL.name: FUEL.short}
    rows = [row for row in scores if row.statistic == STATISTIC]
    far = [row for row in rows if row.equal_size > row.floor_high]
    near = [row for row in rows if row.equal_size <= row.floor_high and row.n_each >= MIN_PAIRS]
    unknown = [names[row.quantity] for row in rows if row not in far and row not in near]
    course, auc = "the course of single descents", detection.auc
    lines = []
    if near:
        listed = ", ".join(names[row.quantity] for row in near)
        lines.append(f"good enough for the distribution of {listed}: as near to held-out flights as other flights are")
    if auc <= PASSING_AUC:
        lines.append(f"good enough for {course}: a classifier guesses little better than chance, AUC {auc:.2f}")
    for row in far:
        off = f"{row.equal_size / row.floor:.1f} noise floors off" if row.floor else "held-out flights are all alike"
        lines.append(f"not for the distribution of {names[row.quantity]}: {off}")
    if auc > PASSING_AUC:
        lines.append(f"not for {course}: a classifier tells samples from flights, AUC {auc:.2f} (chance is 0.5)")
    if isnan(auc):
        unknown.append(course)
    if unknown:
        lines.append(f"too few held-out flights to judge {', '.join(unknown)}")
    return ";\n".join(lines)
