"""Plan of a study: types and their flights, models, sizes and seeds; written down before it starts."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from descentflow.core.errors import ConfigError
from descentflow.core.files import write_whole
from descentflow.evaluation.metrics.score_registry import STATISTICS

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PAPER_FLIGHTS = {
    "B738": 41_011,
    "A320": 28_723,
    "A319": 20_968,
    "DH8D": 10_821,
    "E190": 6_046,
    "B772": 2_517,
    "A388": 1_419,
    "C56X": 1_089,
    "E170": 1_057,
    "AT76": 872,
    "PC12": 701,
    "F2TH": 585,
    "BE20": 257,
}
"""Flights of each type (paper, table 1): 116,066 in all."""
MODELS = {
    "gaussian": "Gaussian",
    "gmm": "Gaussian mixture",
    "flow": "Masked affine flow",
}
"""Settings file of `configs/model/` -> name in tables."""
PAPER_STATISTICS = {name: STATISTICS[name] for name in ("ks", "wasserstein", "mae")}
"""Statistics of the paper's tables."""


@dataclass(frozen=True)
class Recipe:
    """Settings by which the models of a study are fitted.

    Attributes:
        models: Those it has, each with the settings file that trains it.
        data: Options of :class:`~descentflow.training.datamodule.DescentDataModule` that are not the defaults.

    Example:
        >>> RECIPES["paper"].models["flow"], RECIPES["paper"].data["fpca"]
        ('flow_paper', 'iterative')
    """

    models: dict[str, str]
    data: dict[str, object]


RECIPES = {
    "own": Recipe({name: name for name in MODELS}, {}),
    "paper": Recipe(
        {"gaussian": "gaussian_paper", "gmm": "gmm_paper", "flow": "flow_paper"},
        {
            "validation_fraction": 0.0,
            "fpca": "iterative",
            "gaps": "filled",
            "bounds": "paper",
            "drag_scale": "newton",
            "residual": False,
            "cas_explained_variance": 0.8,
        },
    ),
}
"""Ours, and the paper's own: its 80:20 split, its gappy fPCA, mixtures with its cap, its flow with nothing added."""
LAST = "flights.json"
"""The last file of a type's folder: where it is, the type is done."""


@dataclass(frozen=True)
class StudyPlan:
    """All that decides a study's results.

    Attributes:
        flights: Simulated flights of each type; of a store of real descents, the types that are studied.
        models: Names of :data:`MODELS`.
        seed: Of simulation, fits and samples; the split is the DataModule's own.
        n_samples: Samples of each model (the paper's 10,000).
        store: Prepared descents to use instead of simulated ones.
        max_epochs: Bound on the epochs of every fit; each config's own if absent.
        scenario: Settings of the simulated world, see :mod:`descentflow.simulation.scenarios`.
        recipe: Name of :data:`RECIPES`.

    Example:
        >>> StudyPlan({"A320": 2_000}, models=("gaussian", "flow")).n_samples
        10000
    """

    flights: dict[str, int]
    models: tuple[str, ...] = tuple(MODELS)
    seed: int = 0
    n_samples: int = 10_000
    store: str | None = None
    max_epochs: int | None = None
    scenario: str = "london-fir-2019"
    recipe: str = "own"

    def __post_init__(self) -> None:
        """Refuse a plan that cannot be carried out."""
        if self.recipe not in RECIPES:
            raise ConfigError(f"recipe {self.recipe!r}", expected=f"one of {', '.join(RECIPES)}", mend="choose another")
        known = RECIPES[self.recipe].models
        unknown = [name for name in self.models if name not in known]
        if unknown or not self.models or not self.flights:
            raise ConfigError(
                f"models {', '.join(unknown or self.models) or 'none'}, types {', '.join(self.flights) or 'none'}",
                expected=f"some of {', '.join(known)}, and at least one type",
                mend="name others",
            )
        if self.n_samples < 2 or self.seed < 0 or min(self.flights.values()) < 50:
            raise ConfigError(
                f"{self.n_samples} samples, seed {self.seed}, {min(self.flights.values())} flights of a type",
                expected="two samples, a seed of 0 and 50 flights of every type at the least",
                mend="ask for more",
            )


def paper_plan(share: float = 1.0, typecodes: list[str] | None = None, **settings: object) -> StudyPlan:
    """The paper's types at a share of its counts.

    Args:
        share: Of the paper's flights; no type gets fewer than 150, too few for a test part.
        typecodes: Types; all thirteen if absent.
        **settings: Other fields of :class:`StudyPlan`.

    Raises:
        ConfigError: If a type is not among the thirteen or the share is not positive.

    Example:
        >>> paper_plan(0.1, ["A320"]).flights
        {'A320': 2872}
    """
    chosen = typecodes or list(PAPER_FLIGHTS)
    unknown = [name for name in chosen if name not in PAPER_FLIGHTS]
    if unknown or not share > 0:
        raise ConfigError(
            f"types {', '.join(chosen)} at a share of {share:g}",
            expected=f"some of {', '.join(PAPER_FLIGHTS)}, and a positive share",
            mend="name others",
        )
    flights = {name: max(round(share * PAPER_FLIGHTS[name]), min(150, PAPER_FLIGHTS[name])) for name in chosen}
    return StudyPlan(flights, **settings)  # type: ignore[arg-type]


def begun(folder: Path) -> StudyPlan:
    """The plan of the study that a folder holds.

    Raises:
        ConfigError: If it holds none.

    Example:
        >>> begin(StudyPlan({"A320": 200}), Path("study_of_200"))
        >>> begun(Path("study_of_200")).flights
        {'A320': 200}
    """
    try:
        plan = json.loads((folder / "plan.json").read_text())
        return StudyPlan(**{**plan, "models": tuple(plan["models"])})
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ConfigError(
            f"no plan of a study in {folder}", expected="its plan.json", mend="run scripts/paper_study.py there first"
        ) from error


def begin(plan: "DataclassInstance", folder: Path) -> None:
    """Write the plan into the study's folder, or check that a study begun there is the same.

    Raises:
        ConfigError: If the folder holds another study.

    Example:
        >>> begin(StudyPlan({"A320": 200}), Path("study_begun"))
        >>> begin(StudyPlan({"A320": 300}), Path("study_begun"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.ConfigError: study_begun holds a study of another plan...
    """
    folder.mkdir(parents=True, exist_ok=True)
    path, text = folder / "plan.json", json.dumps(asdict(plan), indent=1)
    if not path.exists():
        write_whole(path, text)
    elif path.read_text() != text:
        raise ConfigError(
            f"{folder} holds a study of another plan",
            expected="the plan in its plan.json, to go on with it",
            mend="choose another folder, or the same settings as before",
        )
