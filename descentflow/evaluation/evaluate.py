"""Sample a model and score it against held-out flights: what the callback, `test` and `evaluate` all do."""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import polars as pl
from matplotlib.figure import Figure
from torch import Tensor

from descentflow.core.errors import DataError
from descentflow.core.files import whole_file
from descentflow.evaluation.figures.acceptance import acceptance_figure
from descentflow.evaluation.figures.components import components_figure
from descentflow.evaluation.figures.distances_by_level import level_scores_figure
from descentflow.evaluation.figures.level_cuts import cuts_figure
from descentflow.evaluation.figures.profile_bands import profiles_figure
from descentflow.evaluation.metrics.bootstrap import score_intervals
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.score_table import ScoreTable
from descentflow.evaluation.metrics.scores import score
from descentflow.generation.rejection import ConditionalSampler, sample_descents
from descentflow.generation.samples import RejectionReport
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.representation.profiles import Profiles
from descentflow.representation.representation import Representation


@dataclass(frozen=True)
class Evaluation:
    """Samples beside real flights, their scores, and what was rejected on the way."""

    name: str
    samples: DescentSet
    real: DescentSet
    nominal: DescentSet
    scores: ScoreTable
    rejections: RejectionReport
    representation: Representation

    def figures(self) -> dict[str, Figure]:
        """Figures by name: samples against flights (paper, figures 4-6), distances, rejections, components."""
        decoder = self.representation.decoder
        profiles = profiles_figure(self.real, {self.name: self.samples}, self.nominal, title=decoder.aircraft.typecode)
        return {
            "profiles": profiles,
            "cuts": cuts_figure(self.real, {self.name: self.samples}, self.nominal, self._cut_fl()),
            "distance_by_level": level_scores_figure(self.scores, decoder.transition_fl),
            "rejections": acceptance_figure(self.rejections),
            "components": components_figure(decoder.drag_basis, decoder.cas_basis, decoder.levels_fl),
        }

    def _cut_fl(self) -> float:
        """The transition, as in the paper's figures 8 and 9; the middle of the grid where the grid has none."""
        levels, transition = self.real.levels_fl, self.representation.decoder.transition_fl
        inside = float(levels[0]) < transition < float(levels[-1])
        return transition if inside else float(levels[len(levels) // 2])

    def intervals(self, n_resamples: int, seed: int = 0) -> pl.DataFrame:
        """90 % intervals of the scores over held-out flights: columns ``quantity statistic low high``."""
        transition_fl = self.representation.decoder.transition_fl
        found = score_intervals(self.samples, self.real, transition_fl, seed, n_resamples)
        return pl.DataFrame([asdict(one) for one in found]).fill_nan(None)

    def write(self, folder: Path, *, figures: bool = True) -> None:
        """Write `scores.csv`, `rejections.json` and, unless they are not wanted, the figures as PNG."""
        folder.mkdir(parents=True, exist_ok=True)
        self.scores.write_csv(folder / "scores.csv")
        with whole_file(folder / "rejections.json") as temporary:
            temporary.write_text(json.dumps(self.rejections.as_dict(), indent=1))
        for name, figure in self.figures().items() if figures else ():
            with whole_file(folder / f"{name}.png") as temporary:
                figure.savefig(temporary, dpi=110)


def evaluate(
    model: ConditionalSampler,
    representation: Representation,
    real: Profiles,
    *,
    context: Tensor | None = None,
    n: int = 10_000,
    seed: int = 0,
    name: str = "samples",
    n_splits: int = 20,
    progress: Callable[[int], None] | None = None,
    score_progress: Callable[[int], None] | None = None,
) -> Evaluation:
    """Sample as many descents as asked and compare them with flights (paper, section 4).

    Entry levels are drawn from those of the flights (paper, section 4.2); a conditional model is given, for each
    sample, the entry level and the context of one flight.

    Args:
        model: Latent model.
        representation: Its decoder and bounds.
        real: Held-out flights on the decoder's grid.
        context: (flights, c) encoded context of the flights, where the model takes one.
        n: Number of samples.
        seed: Of sampling and of the splits behind the floors.
        name: The model's name in figures.
        n_splits: Halvings of the flights behind each floor.
        progress: Called with the number of newly accepted samples.
        score_progress: Called with 1 after each of ``3 n_splits`` comparisons.

    Raises:
        DataError: If there is no flight to compare with.
        SamplingError: If too few draws are plausible.
    """
    if len(real) == 0:
        raise DataError(
            "no flight to score against",
            expected="flights that the checkpoint was not trained on",
            mend="pass other prepared descents",
        )
    decoder = representation.decoder
    samples = sample_descents(
        model,
        decoder,
        representation.plausibility,
        n,
        seed,
        context=context,
        entry=real.entry_level,
        progress=progress,
    )
    generated, observed = DescentSet.of_trajectories(samples.trajectories), DescentSet.of_profiles(real)
    nominal = DescentSet.of_nominal(nominal_descent(decoder.aircraft, decoder.levels_fl.cpu()))
    scores = score(generated, observed, decoder.transition_fl, nominal, seed, n_splits, progress=score_progress)
    return Evaluation(name, generated, observed, nominal, scores, samples.report, representation)
