"""What the sections of a run's page hold, each from a file of the run."""

import json
from pathlib import Path
from typing import Any

import polars as pl

from descentflow.densities.checkpoint_summary import CheckpointSummary
from descentflow.evaluation.metrics.score_registry import rows as score_rows
from descentflow.reporting.html_elements import Cell, Html, details, paragraph, preformatted, stacked_table, table
from descentflow.reporting.html_figures import figure
from descentflow.reporting.number_text import number
from descentflow.reporting.svg_figures import drawn_for_both
from descentflow.training.run_page.found_run import SETTINGS, Run
from descentflow.training.run_page.history_figures import LOSSES, loss_figure, scores_figure
from descentflow.training.run_page.run_history import RunHistory

PICTURES = {
    "profiles": (
        "Drag, CAS and time against flight level: held-out flights on the left, samples on the right",
        "Thin lines are single descents, of the held-out flights in one column and of the samples in the other; both "
        "have the mean of the held-out flights and nominal BADA.",
    ),
    "cuts": (
        "Distributions of the time to the lowest level, and of CAS and rate at one level, of flights and of samples",
        "Above, smoothed densities; below, distribution functions, which need no smoothing.",
    ),
    "distance_by_level": (
        "Distance between samples and flights at every level, beside the distance between flights and other flights",
        "Inside the band, samples are as near to the flights as other flights are.",
    ),
    "components": ("Mean and components of drag and of CAS against flight level", "What the model's weights multiply."),
    "classifier": (
        "What a classifier looks at to tell samples from flights, by quantity and levels",
        "The larger the loss without it, the more it gives the samples away.",
    ),
}
"""Figure that `descentflow test` writes -> what it shows, and the text below it."""


def model_section(summary: CheckpointSummary) -> list[Html]:
    """What the checkpoint holds, a line each.

    Example:
        >>> from descentflow.densities.checkpoint_summary import checkpoint_summary
        >>> "A320" in model_section(checkpoint_summary("best.ckpt"))[0]
        True
    """
    head, *lines = str(summary).splitlines()
    rows = [["model", head], *([*line.split(": ", 1)] for line in lines if not line.startswith("score"))]
    if summary.score is not None:
        name, value = summary.score
        rows.append(["kept epoch", f"{summary.epoch}, with {name} {value:.4g} nats per flight, the lower the better"])
    return [stacked_table(["", ""], rows, align="l")]


def loss_section(history: RunHistory, monitor: str) -> list[str]:
    """The loss by epoch, and what it came down to.

    Example:
        >>> loss_section(RunHistory(), "val/nll")
        ['Nothing was logged while it trained, or its events are gone.']
    """
    shown = [name for name in LOSSES if name in history.series]
    if not shown:
        return ["Nothing was logged while it trained, or its events are gone."]
    best = history.best(monitor)
    kept = "" if best is None else f"the epoch that was kept is {best[0]}, with {monitor} {best[1]:.4g}"
    told = "; ".join(
        f"{LOSSES[name][0]} from {history.series[name][1][0]:.4g} to {history.series[name][1][-1]:.4g}"
        for name in shown
    )
    alt = f"Negative log-likelihood in nats per flight by epoch: {told}; {kept}."
    caption = f"The lower the better; {kept}." if kept else "The lower the better."
    return [drawn_for_both(lambda narrow: loss_figure(history, monitor, narrow=narrow), "loss", alt, caption)]


def epochs_section(history: RunHistory) -> list[str]:
    """Scores of validation flights by epoch, beside their noise floors; nothing where none were logged.

    Example:
        >>> import numpy as np
        >>> logged = {f"val/score/cas_below_transition/ks_{name}": value
        ...           for name, value in (("equal_size", 0.2), ("floor", 0.1))}
        >>> history = RunHistory({name: (np.array([1.0]), np.array([value])) for name, value in logged.items()})
        >>> "in the last one 1 of 1 scores are above their floor" in epochs_section(history)[0]
        True
    """
    if not history.scored():
        return []
    pairs = {
        name: (history.series[name][1][-1], history.series[floor][1][-1]) for name, floor in history.scored().items()
    }
    above = sum(value > floor for value, floor in pairs.values())
    epochs = len(next(iter(history.series[name][0] for name in pairs)))
    alt = (
        f"Scores of validation flights in {epochs} epoch(s), each beside the noise floor; in the last one {above} of "
        f"{len(pairs)} scores are above their floor."
    )
    caption = (
        "Distances of samples from validation flights, as many of each, beside the distance between flights and other "
        "flights. --scores.every_n_epochs says how often they are taken."
    )
    return [drawn_for_both(lambda narrow: scores_figure(history, narrow=narrow), "scores", alt, caption)]


def scores_section(folder: Path) -> list[Html]:
    """Scores beside their noise floors, from ``scores.csv``; those above the floor are marked and said to be.

    Example:
        >>> row = {"quantity": "cas_below_transition", "statistic": "ks", "unit": "1", "score": 0.31, "nominal": 0.9}
        >>> row |= {"equal_size": 0.3, "floor": 0.1, "floor_high": 0.2, "note": ""}
        >>> folder = Path("scored")
        >>> folder.mkdir(exist_ok=True)
        >>> pl.DataFrame([row]).write_csv(folder / "scores.csv")
        >>> "above the floor" in scores_section(folder)[1]
        True
    """
    labels = {(part.name, one.name): (part.label, one.label) for part, one in score_rows(costly=True)}
    shown = []
    for row in pl.read_csv(folder / "scores.csv", infer_schema_length=None).iter_rows(named=True):
        part, statistic = labels.get((row["quantity"], row["statistic"]), (row["quantity"], row["statistic"]))
        unit = "" if row["unit"] == "1" else f" {row['unit']}"
        shown.append(
            [
                part,
                statistic,
                f"{number(row['score'])}{unit * (row['score'] is not None)}",
                _beside_floor(row, unit),
                _with_range(row, unit),
                f"{number(row['nominal'])}{unit * (row['nominal'] is not None)}",
            ]
        )
    head = [
        "quantity",
        "statistic",
        "samples against flights",
        "the same, as many of each",
        "noise floor",
        "nominal BADA",
    ]
    told = (
        "The noise floor is the distance between flights and as many other flights, with its 95th percentile over "
        "random splits: a score below that is no further from the flights than flights may be by chance."
    )
    return [paragraph(told), table(head, shown, align="llr", grouped=True, stacked=True)]


def _beside_floor(row: dict[str, Any], unit: str) -> Cell:
    value, high = row["equal_size"], row["floor_high"]
    if value is None:
        return Cell("-", note=row["note"] or "")
    if high is None:
        return Cell(f"{number(value)}{unit}")
    inside = value <= high
    return Cell(
        f"{number(value)}{unit}", "good" if inside else "bad", "as flights are" if inside else "above the floor"
    )


def _with_range(row: dict[str, Any], unit: str) -> Cell:
    if row["floor"] is None:
        return Cell("-")
    return Cell(
        f"{number(row['floor'])}{unit}", note="" if row["floor_high"] is None else f"up to {number(row['floor_high'])}"
    )


def rejections_section(folder: Path) -> list[Html]:
    """What became of the draws, from ``rejections.json``.

    Example:
        >>> found = {"drawn": 200, "accepted": 150, "acceptance": 0.75, "broken": {"cas_above_bound": 50}}
        >>> folder = Path("scored")
        >>> folder.mkdir(exist_ok=True)
        >>> _ = (folder / "rejections.json").write_text(json.dumps(found))
        >>> text, rules = rejections_section(folder)
        >>> "150 samples from 200 draws" in text, "CAS above bound" in rules, "25.0 %" in rules
        (True, True, True)
    """
    found = json.loads((folder / "rejections.json").read_text())
    drawn = max(int(found["drawn"]), 1)
    rows = [
        [rule.replace("_", " ").replace("cas", "CAS"), number(int(count)), f"{100 * count / drawn:.1f} %"]
        for rule, count in found["broken"].items()
    ]
    text = (
        f"{int(found['accepted']):,} samples from {int(found['drawn']):,} draws, of which "
        f"{100 * found['acceptance']:.1f} % are plausible. A draw that breaks several rules counts under each."
    )
    return [paragraph(text), stacked_table(["rule", "draws that break it", "of all"], rows)]


def pictures(folder: Path, names: tuple[str, ...]) -> list[Html]:
    """Figures that `descentflow test` wrote, those of these names that are there.

    Example:
        >>> from matplotlib.figure import Figure
        >>> folder = Path("with_cuts")
        >>> folder.mkdir(exist_ok=True)
        >>> Figure(figsize=(1, 1)).savefig(folder / "cuts.png")
        >>> shown = pictures(folder, ("profiles", "cuts"))
        >>> len(shown), PICTURES["cuts"][0] in shown[0]
        (1, True)
    """
    return [
        figure(path, f"{PICTURES[name][0]}.", PICTURES[name][1])
        for name in names
        if (path := folder / f"{name}.png").is_file()
    ]


def settings_section(run: Run) -> list[Html]:
    """Hyper-parameters of the model and the data as a table, and the whole file folded.

    Example:
        >>> folder = Path("with_settings")
        >>> folder.mkdir(exist_ok=True)
        >>> _ = (folder / SETTINGS).write_text("seed_everything: 7")
        >>> rows, whole = settings_section(Run(folder, Path("best.ckpt"), {"seed_everything": 7}))
        >>> "seed" in rows, "seed_everything: 7" in whole
        (True, True)
    """
    model = run.settings.get("model") or {}
    rows = [["model", "class", str(model.get("class_path", "-")).rpartition(".")[2]]]
    for section, options in (("model", model.get("init_args") or {}), ("data", run.settings.get("data") or {})):
        rows += [
            [section, name.replace("_", " "), _shown(value)] for name, value in options.items() if value is not None
        ]
    trainer = run.settings.get("trainer") or {}
    rows += [["trainer", "epochs at most", _shown(trainer.get("max_epochs"))]]
    rows += [["trainer", "seed", _shown(run.settings.get("seed_everything"))]]
    return [
        table(["of", "setting", "value"], rows, align="lll", grouped=True),
        details(f"The whole of {SETTINGS}", preformatted((run.folder / SETTINGS).read_text(encoding="utf-8"))),
    ]


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else "-" if value is None else str(value)
