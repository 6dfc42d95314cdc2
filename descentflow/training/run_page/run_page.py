"""One page of a run, written into its folder: what `descentflow open` does."""

from collections.abc import Callable
from pathlib import Path

from descentflow.core.files import check_output
from descentflow.core.progress import stage
from descentflow.densities.checkpoint_summary import CheckpointSummary, checkpoint_summary
from descentflow.evaluation.evaluate import N_SPLITS, evaluate
from descentflow.evaluation.metrics.scores import n_comparisons
from descentflow.reporting.html_elements import Html, answer, code, paragraph
from descentflow.reporting.html_page import HtmlPage
from descentflow.training.run_page.found_run import Run, find_run
from descentflow.training.run_page.run_history import RunHistory, run_history
from descentflow.training.run_page.run_sections import (
    epochs_section,
    loss_section,
    model_section,
    pictures,
    rejections_section,
    scores_section,
    settings_section,
)

SAMPLES = 10_000
"""Samples that are scored, as `descentflow test` scores them: the paper's number."""


def write_run_page(path: str | Path, *, n: int = SAMPLES, seed: int = 0) -> Path:
    """Write the page of a run into its folder, whole or not at all.

    Scores of the held-out flights are those that `descentflow test` wrote. Where there are none of this checkpoint, and
    the descents that it was trained on are still where they were, they are taken first, and written as `test` does.

    Args:
        path: Folder of the run, or its checkpoint.
        n: Samples that are scored where there are no scores yet.
        seed: Of these samples.

    Returns:
        The page's path: ``run.html`` in the run.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If there is no run.
        DataError: If the run's files cannot be read, or its page cannot be written.

    Example:
        >>> write_run_page("descents.parquet")
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: no run at descents.parquet; expected ...
    """
    run = find_run(path)
    check_output(run.page)
    with stage("reading the run"):
        summary = checkpoint_summary(run.checkpoint)
        history = run_history(run.folder)
    missing = _score(run, n, seed)
    with stage("drawing figures and writing"):
        _page(run, summary, history, missing).write(run.page)
    return run.page


def _score(run: Run, n: int, seed: int) -> str:
    """Take the scores unless they are there; why there are none, or nothing."""
    if run.is_scored:
        return ""
    gone = [str(one) for one in run.descents if not one.exists()]
    if gone or not run.descents:
        return f"The descents that it was trained on are not at {', '.join(gone) or 'any known path'}"
    table = (run.settings.get("data") or {}).get("context_table")
    with stage("reading descents") as shown:
        found = evaluate(
            run.checkpoint,
            run.descents,
            n=n,
            seed=seed,
            context_table=None if table is None else Path(table),
            progress=shown.part("drawing descents", n, "descents"),
            score_progress=shown.part("scoring", n_comparisons(N_SPLITS), "comparisons"),
        )
    with stage("drawing figures and writing scores"):
        found.write(run.scored)
    return ""


def _page(run: Run, summary: CheckpointSummary, history: RunHistory, missing: str) -> HtmlPage:
    decoder = summary.density.representation.decoder
    levels = decoder.levels_fl
    name = type(summary.density).__name__.removesuffix("Density")
    title = f"{run.folder.parent.name}/{run.folder.name}: {name} of {decoder.aircraft.typecode}"
    page = HtmlPage(
        title, [f"Descents from FL{levels[-1]:.0f} to FL{levels[0]:.0f}, learned from {_flights(summary)}."]
    )
    page.section("The model", *model_section(summary))
    page.section(
        "Profiles against held-out flights", *_or_missing(run, missing, lambda: pictures(run.scored, ("profiles",)))
    )
    page.section("Scores beside noise floors", *_or_missing(run, missing, lambda: _scores(run.scored)))
    page.section("Loss by epoch", *loss_section(history, _monitor(run)))
    if by_epoch := epochs_section(history):
        page.section("Scores by epoch", *by_epoch)
    page.section("Rejections", *_or_missing(run, missing, lambda: rejections_section(run.scored)))
    page.section("Components", *_or_missing(run, missing, lambda: pictures(run.scored, ("components",))))
    page.section("Settings", *settings_section(run))
    return page


def _scores(folder: Path) -> list[Html]:
    return [*scores_section(folder), *pictures(folder, ("cuts", "distance_by_level", "classifier"))]


def _or_missing(run: Run, missing: str, content: "Callable[[], list[Html]]") -> list[Html]:
    """The content, or why it is not there and how to get it."""
    if not missing:
        return content()
    command = f"descentflow test --ckpt_path {run.checkpoint} --data.descents FILE"
    return [answer([f"{missing}."], "warn"), paragraph("To have this: ", code(command), ", then open the run again.")]


def _flights(summary: CheckpointSummary) -> str:
    split = summary.density.representation.split
    return f"{len(split.train):,} flights, validated on {len(split.validation):,} and held against {len(split.test):,}"


def _monitor(run: Run) -> str:
    return str((run.settings.get("checkpoint") or {}).get("monitor", "val/nll"))
