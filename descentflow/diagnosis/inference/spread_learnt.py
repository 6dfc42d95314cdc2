"""Which flights say how widely flights differ, before effects are fitted and after, and the likelihoods of either."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from descentflow.core.freed_memory import give_back
from descentflow.diagnosis.inference.discrepancy import DiscrepancyColumns
from descentflow.diagnosis.inference.likelihood import EffectsLikelihood
from descentflow.diagnosis.inference.mean_air import in_mean_air
from descentflow.diagnosis.inference.normal_flights import is_narrow, left_between_means, normal_flights
from descentflow.diagnosis.inference.selection import Chosen, searched, select
from descentflow.diagnosis.inference.two_sides import Compared
from descentflow.diagnosis.inference.whitening import whiten
from descentflow.effects import Effect


@dataclass(frozen=True)
class SpreadLearnt:
    """Flights weighed by a spread that was learnt from some of them.

    Attributes:
        likelihood: Of the flights as they are.
        searched: Of the flights among which causes are searched: in their mean air, where the spread does not know
            their weather.
        narrow: Whether the simulator's flights differ too little to say the spread.

    Example:
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> learnt = SpreadLearnt.of(example_sides(), EFFECTS, seed=0)
        >>> learnt.narrow, learnt.searched is learnt.likelihood  # in the example all are in one air
        (False, True)
    """

    likelihood: EffectsLikelihood
    searched: EffectsLikelihood
    narrow: bool

    @classmethod
    def of(
        cls, compared: Compared, catalogue: Mapping[str, Effect], seed: int, *, narrow: bool | None = None
    ) -> "SpreadLearnt":
        """Learn the spread, from real flights where the simulator's are too ``narrow`` (asked of them if absent)."""
        narrow = is_narrow(compared) if narrow is None else narrow
        learn = normal_flights(compared, narrow=narrow)
        apart, groups, least = compared.of_flight(), compared.airframe, compared.negligible() ** 2
        weights = whiten(compared.y, compared.real, groups, compared.nugget(), apart, learn=learn, least=least)
        likelihood = searched = EffectsLikelihood(compared, weights, catalogue, seed)
        if learn is not None and not bool((learn & compared.real).any()):
            mean = in_mean_air(compared, weights, catalogue)
            if mean is not compared:
                searched = EffectsLikelihood(mean, weights, catalogue, seed, likelihood)
        return cls(likelihood, searched, narrow)


def select_by_either(
    learnt: SpreadLearnt, discrepancy: DiscrepancyColumns, seed: int, progress: Callable[[str], None]
) -> tuple[SpreadLearnt, Chosen]:
    """Name effects; again with the spread of real flights, where these differ in more than what was found.

    Either the simulator's flights differ too little, or some of the real ones have an effect that was not found flight
    by flight, which then hides itself in their spread: what leaves less between the means is taken.

    Args:
        learnt: The spread that is tried first.
        discrepancy: Columns of a shift without a cause.
        seed: Of folds.
        progress: Called with what is being done.

    Example:
        >>> from descentflow.diagnosis.inference.discrepancy import discrepancy_columns
        >>> from descentflow.diagnosis.inference.example_sides import example_sides
        >>> from descentflow.effects import EFFECTS
        >>> sides, only = example_sides(EFFECTS["mass"], [0.2]), {"mass": EFFECTS["mass"]}
        >>> learnt = SpreadLearnt.of(sides, only, seed=0)
        >>> same, chosen = select_by_either(learnt, discrepancy_columns(sides), 0, lambda stage: None)
        >>> same is learnt, chosen.fit.effects
        (True, ('mass',))
    """
    first = searched(learnt.searched, discrepancy, progress)
    if learnt.narrow or not is_narrow(learnt.searched.compared, first.fit.shift):
        return learnt, first.chosen
    progress("learning the spread from real flights")
    real = _learnt_from_real_flights(learnt, seed)
    again = select(real.searched, discrepancy, progress)
    left = [left_between_means(learnt.likelihood.compared, one.fit.shift) for one in (first, again)]
    return (real, again) if left[1] < left[0] else (learnt, first.chosen)


def _learnt_from_real_flights(first: SpreadLearnt, seed: int) -> SpreadLearnt:
    """The spread for the second search; what is kept of the first would lie beside all that this one keeps."""
    for likelihood in (first.likelihood, first.searched):
        likelihood.forget()
    give_back()
    return SpreadLearnt.of(first.likelihood.compared, first.likelihood.catalogue, seed, narrow=True)
