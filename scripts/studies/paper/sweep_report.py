"""Sections of the report about the sweeps that are there."""

import json
from pathlib import Path

import polars as pl

from descentflow.reporting.pages import figure
from studies.page_elements import Html, cell, number, paragraph, table
from studies.paper.figures.sweep_curves import STATISTICS, flow_sizes_figure, variance_figure
from studies.paper.hidden_levels import METHODS
from studies.paper.study_plan import StudyPlan
from studies.paper.sweeps import PAPER_SIZE


def sweep_sections(plan: StudyPlan, folder: Path) -> list[tuple[str, list[Html]]]:
    """Heading and HTML of each sweep of which files are there.

    Args:
        plan: The study.
        folder: Its folder.

    Returns:
        A section per sweep; none where no sweep was run.

    Example:
        >>> own = Path("study_swept/sweeps/flow")
        >>> own.mkdir(parents=True)
        >>> for flows, nll in ((5, 5.5), (8, 5.4)):
        ...     result = {"flows": flows, "hidden": 2, "nll": nll, "parameters": 900}
        ...     _ = (own / f"A320-{flows}-2.json").write_text(json.dumps(result))
        >>> [heading for heading, _ in sweep_sections(StudyPlan({"A320": 120}), Path("study_swept"))]
        ['Sizes of the flow']
    """
    makers = {
        "variance": ("Variance explained by the components", _variance),
        "gappy": ("Levels hidden from gappy flights", _gappy),
        "flow": ("Sizes of the flow", _flow),
    }
    sections = []
    for name, (heading, make) in makers.items():
        order = {typecode: k for k, typecode in enumerate(plan.flights)}
        files = [path for path in (folder / "sweeps" / name).glob("*.[cj]s*[vn]") if _typecode(path) in order]
        files.sort(key=lambda path: (order[_typecode(path)], path.name))
        if files:
            sections.append((heading, make(plan, folder / "sweeps", files)))
    return sections


def _typecode(path: Path) -> str:
    return path.stem.split("-")[0]


def _variance(plan: StudyPlan, folder: Path, files: list[Path]) -> list[Html]:
    """The paper's appendix B."""
    frames = [pl.read_csv(path).with_columns(typecode=pl.lit(_typecode(path))) for path in files]
    scores = pl.concat(frames, how="vertical_relaxed")
    rows: list[list[str]] = []
    for share in sorted(scores["share"].unique()):
        at = scores.filter(pl.col("share") == share)
        each = at.select("typecode", "fold", "components", "clusters").unique()
        scored = at.filter(pl.col("score").is_not_nan())
        medians = [scored.filter(statistic=s)["score"].median() for s in STATISTICS]
        means = [each[column].mean() for column in ("components", "clusters")]
        failed = len(each) - len(scored.select("typecode", "fold").unique())
        rows.append([f"{share:.0%}", *(number(_float(v)) for v in [*means, *medians]), str(failed)])
    head = ["explained", "principal components", "mixture components"]
    head += ["KS", "Wasserstein (ft/min)", "mean (ft/min)", "without samples"]
    folds = f"{len(files)} folds of {scores['typecode'].n_unique()} types"
    text = paragraph(
        f"Mixtures on {folds}; medians over folds, types and both sides of the transition, of the rate. Lines in "
        "boxes are medians, crosses means. The last column counts folds where hardly a draw was plausible."
    )
    drawn = figure(
        variance_figure(scores), "Boxes of scores by explained variance", "Scores of rate on held-out folds."
    )
    return [text, drawn, table(head, rows)]


def _gappy(plan: StudyPlan, folder: Path, files: list[Path]) -> list[Html]:
    """The paper's appendix A."""
    rows: list[list[str]] = []
    for path in files:
        frame = pl.read_csv(path)
        for part in frame.partition_by("quantity", "pattern", maintain_order=True):
            errors_of = dict(part.select("method", "rmse").iter_rows())
            best = min(errors_of.values())
            about = [_typecode(path), f"{part['quantity'][0]}, {part['pattern'][0]}"]
            errors = [cell(number(errors_of[m]), "best" if errors_of[m] == best else "") for m in METHODS]
            rows.append([*about, *errors, number(int(part["n_flights"][0]))])
    text = paragraph(
        "Root mean square error on flight levels that were hidden from every method: from the top of flights, or at "
        "random. Probabilistic PCA is the default."
    )
    # The paper shows the F2TH.
    shown = next((path for path in files if _typecode(path) == "F2TH"), files[-1])
    caption = f"Gappy {_typecode(shown)}: what was observed, and what two methods make of the rest."
    drawn = figure(shown.with_suffix(".png"), "Profiles with hidden flight levels, and their completions", caption)
    return [text, drawn, table(["type", "hidden", *METHODS, "flights"], rows, align="llr", grouped=True)]


def _flow(plan: StudyPlan, folder: Path, files: list[Path]) -> list[Html]:
    """The paper's appendix C."""
    frame = pl.DataFrame([{"typecode": _typecode(path), **json.loads(path.read_text())} for path in files])
    paper = frame.filter(flows=PAPER_SIZE[0], hidden=PAPER_SIZE[1]).select("typecode", paper="nll")
    frame = frame.join(paper, on="typecode").with_columns(gain=pl.col("nll") - pl.col("paper"))
    sizes = frame.select("flows", "hidden").unique().sort("flows", "hidden")
    gains: dict[int, dict[int, list[float]]] = {}
    rows: list[list[str]] = []
    for flows, hidden in sizes.iter_rows():
        at = frame.filter(flows=flows, hidden=hidden)
        gains.setdefault(flows, {})[hidden] = at["gain"].to_list()
        spread = _float(at["gain"].std()) or 0.0
        error = spread / len(at) ** 0.5
        cells = [number(_float(at["parameters"].mean())), number(_float(at["gain"].mean())), f"{error:.2g}"]
        rows.append([str(flows), str(hidden), *cells, f"{int((at['gain'] < 0).sum())} of {len(at)}"])
    head = ["flows", "hidden units per weight", "parameters"]
    head += ["NLL minus that of the paper's size", "standard error", "better"]
    text = paragraph(
        "Masked affine flows of several sizes: held-out NLL (nats per flight) minus that of the paper's size, "
        f"{PAPER_SIZE[0]} flows of {PAPER_SIZE[1]} hidden units per weight; means over types."
    )
    drawn = figure(flow_sizes_figure(gains), "Held-out NLL by size of the flow", "A dot is a type.")
    return [text, drawn, table(head, rows, align="r", grouped=True)]


def _float(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
