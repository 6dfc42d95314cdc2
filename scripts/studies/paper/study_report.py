"""One self-contained HTML page of a study: means over types, the five tables, figures, components, each type."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl

from descentflow.core.errors import DataError
from descentflow.core.tabular import write_table
from studies.page_elements import Html, HtmlPage, paragraph
from studies.paper import fidelity_sections as fidelity
from studies.paper import study_sections as sections
from studies.paper.fidelity_tables import ratios
from studies.paper.study_plan import MODELS, StudyPlan
from studies.paper.study_tables import QUANTITIES, all_scores, means, table
from studies.paper.sweep_report import sweep_sections

INTRODUCTION = Html(
    """<p>Each model was fitted to the training flights of a type and sampled; initial flight levels are those of
the held-out flights. A <b>score</b> is the distance between all samples and all held-out flights; in brackets its
90 % interval over held-out flights. The <b>floor</b> (noise floor) is the distance of 200 held-out flights from as
many others and <b>matched</b> that of 200 samples from the same flights (fewer where fewer than 400 were held out):
a perfect generator has its matched distance at the floor, not at zero. <b>Bold</b>: within 5 % of the best model of
the row. <b>KS</b> is the Kolmogorov-Smirnov distance, <b>mean</b> the error of the mean, both averaged over flight
levels for CAS and rate. <b>BADA</b> is the one nominal descent with the coefficients used here: only its mean can
be compared.</p>"""
)
PUBLISHED = """Grey: the paper's published figures, from other flights and EUROCONTROL's coefficients. They are a
yardstick of order of magnitude, not a target."""


@dataclass(frozen=True)
class Published:
    """The paper's figures: scores (its five tables) and types (its tables 1 and 2); either may be missing.

    Example:
        >>> Published(types=pl.DataFrame({"typecode": ["A320"], "n_trajectories": [28_723]})).scores is None
        True
    """

    scores: pl.DataFrame | None = None
    types: pl.DataFrame | None = None


def read_published(path: Path | None) -> Published:
    """Read the paper's published figures.

    Args:
        path: A folder with ``published_scores.csv`` (columns ``quantity typecode statistic gaussian gmm flow bada``)
            and ``published_types.csv`` (its tables 1 and 2), either of which may be missing, or one CSV of scores;
            ``None`` gives no figures.

    Raises:
        DataError: If the path holds neither.

    Example:
        >>> read_published(None).scores is None
        True
        >>> pl.DataFrame({"typecode": ["A320"], "gmm": [0.1]}).write_csv("published_scores.csv")
        >>> read_published(Path(".")).scores["gmm"].item()
        0.1
    """
    if path is None:
        return Published()
    scores, types = (path / "published_scores.csv", path / "published_types.csv") if path.is_dir() else (path, None)
    frames = [
        None if p is None or not p.exists() else pl.read_csv(p, infer_schema_length=None) for p in (scores, types)
    ]
    if all(frame is None for frame in frames):
        raise DataError(
            f"no published figures at {path}", expected="published_scores.csv", mend="give its folder or the file"
        )
    return Published(*frames)


def write_report(plan: StudyPlan, folder: Path, published: Path | None = None) -> Path:
    """Write ``report.html`` and the tables as CSV from the files that a finished study left.

    Args:
        plan: The study.
        folder: Its folder, see :mod:`studies.paper.study_run`.
        published: The paper's figures, for columns of their own; see :func:`read_published`.

    Returns:
        The page.

    Raises:
        DataError: If ``published`` holds no figures.

    Example:
        >>> folder = Path("study_reported")
        >>> (folder / "A320" / "gmm").mkdir(parents=True)
        >>> one = {"quantity": "time_to_bottom_of_descent", "statistic": "ks"}
        >>> names = "score equal_size floor floor_high over_floor excess nominal worst_fl"
        >>> rest = dict.fromkeys(names.split())
        >>> pl.DataFrame([one | rest]).write_csv(folder / "A320" / "gmm" / "scores.csv")
        >>> pl.DataFrame([one | {"low": 0.1, "high": 0.2}]).write_csv(folder / "A320" / "gmm" / "intervals.csv")
        >>> write_report(StudyPlan({"A320": 120}, models=("gmm",)), folder, published=Path("nowhere"))
        Traceback (most recent call last):
            ...
        descentflow.core.errors.DataError: no published figures at nowhere...
    """
    scores, theirs = all_scores(plan, folder), read_published(published)
    source = "simulated flights" if plan.store is None else plan.store
    lead = [_settings(plan), INTRODUCTION]
    if theirs.scores is not None:
        lead.append(paragraph(PUBLISHED, kind="reference"))
    page = HtmlPage(f"Study of {len(plan.flights)} types: {sum(plan.flights.values()):,} {source}", lead)
    page.section("Flights, and what BADA's mass explains of them", *sections.flights(plan, folder, theirs.types))
    page.section("Means over types", *sections.means_over_types(means(scores), plan.models))
    at_one_size = ratios(scores)
    write_table(at_one_size, folder / "over_floor.csv")
    page.section("Distances over their noise floor", *fidelity.over_floor(at_one_size, plan))
    page.section("Whole descents", *fidelity.descents(plan, folder))
    page.section("Scores over types", sections.boxes(scores, plan))
    page.section("Likelihood of held-out flights", *sections.likelihoods(plan, folder))
    for quantity, heading in QUANTITIES.items():
        listed = table(scores, quantity, theirs.scores)
        write_table(listed, folder / f"{quantity}.csv")
        page.section(heading, *sections.scores_of_quantity(listed, plan.models))
    page.section("Components of profiles and mixtures", *sections.components(plan, folder, theirs.types))
    page.section("Rejected draws", sections.rejections(plan, folder))
    for heading, content in sweep_sections(plan, folder):
        page.section(heading, *content)
    for typecode in plan.flights:
        page.section(typecode, *sections.of_type(folder / typecode))
    page.write(folder / "report.html")
    return folder / "report.html"


def _settings(plan: StudyPlan) -> Html:
    models = ", ".join(MODELS[name] for name in plan.models)
    source = f"simulated, scenario {plan.scenario}" if plan.store is None else "prepared from a store"
    recipe = ", by the paper's own recipe" if plan.recipe == "paper" else ""
    epochs = "" if plan.max_epochs is None else f" at most {plan.max_epochs} epochs,"
    return paragraph(
        f"Flights: {source}. Models: {models}{recipe};{epochs} {plan.n_samples:,} samples of each, seed {plan.seed}.",
        kind="lead",
    )
