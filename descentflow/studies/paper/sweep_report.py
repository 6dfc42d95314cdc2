"""Sections of the report about the sweeps that are there."""

import json
from pathlib import Path

import polars as pl

from descentflow.studies.paper.figures.sweep_curves import STATISTICS, flow_sizes_figure, variance_figure
from descentflow.studies.paper.hidden_levels import METHODS
from descentflow.studies.paper.study_page import Cell, number, picture, picture_of, png, rows
from descentflow.studies.paper.study_plan import StudyPlan
from descentflow.studies.paper.sweeps import PAPER_SIZE


def sweep_sections(plan: StudyPlan, folder: Path) -> list[tuple[str, str]]:
    """Heading and HTML of each sweep of which files are there."""
    makers = {
        "variance": ("Variance explained by the components", _variance),
        "gappy": ("Levels hidden from gappy flights", _gappy),
        "flow": ("Sizes of the flow", _flow),
    }
    found = []
    for name, (heading, make) in makers.items():
        order = {typecode: k for k, typecode in enumerate(plan.flights)}
        files = [path for path in (folder / "sweeps" / name).glob("*.[cj]s*[vn]") if _typecode(path) in order]
        files.sort(key=lambda path: (order[_typecode(path)], path.name))
        if files:
            found.append((heading, make(plan, folder / "sweeps", files)))
    return found


def _typecode(path: Path) -> str:
    return path.stem.split("-")[0]


def _variance(plan: StudyPlan, folder: Path, files: list[Path]) -> str:
    """The paper's appendix B."""
    frames = [pl.read_csv(path).with_columns(typecode=pl.lit(_typecode(path))) for path in files]
    scores = pl.concat(frames, how="vertical_relaxed")
    lines: list[list[Cell]] = []
    for share in sorted(scores["share"].unique()):
        at = scores.filter(pl.col("share") == share)
        each = at.select("typecode", "fold", "components", "clusters").unique()
        scored = at.filter(pl.col("score").is_not_nan())
        medians = [scored.filter(statistic=s)["score"].median() for s in STATISTICS]
        means = [each[column].mean() for column in ("components", "clusters")]
        failed = len(each) - len(scored.select("typecode", "fold").unique())
        lines.append([f"{share:.0%}", *(number(_float(v)) for v in [*means, *medians]), str(failed)])
    head = ["explained", "components", "clusters", "KS", "Wasserstein (ft/min)", "mean (ft/min)", "without samples"]
    folds = f"{len(files)} folds of {scores['typecode'].n_unique()} types"
    text = f"<p>Mixtures on {folds}; medians over folds, types and both sides of the transition, of the rate. Lines in "
    text += "boxes are medians, crosses means. The last column counts folds where hardly a draw was plausible.</p>"
    return text + picture_of(png(variance_figure(scores)), "Scores of rate on held-out folds.") + rows(head, lines)


def _gappy(plan: StudyPlan, folder: Path, files: list[Path]) -> str:
    """The paper's appendix A."""
    lines: list[list[Cell]] = []
    for path in files:
        frame = pl.read_csv(path)
        for part in frame.partition_by("quantity", "pattern", maintain_order=True):
            found = dict(part.select("method", "rmse").iter_rows())
            best = min(found.values())
            about = [_typecode(path), f"{part['quantity'][0]}, {part['pattern'][0]}"]
            marked: list[Cell] = [(number(found[m]), "best" if found[m] == best else "") for m in METHODS]
            lines.append([*about, *marked, number(int(part["n_flights"][0]))])
    text = "<p>Root mean square error on levels that were hidden from every method: from the top of flights, or at "
    text += "random. Probabilistic PCA is the default.</p>"
    # The paper shows the F2TH.
    shown = next((path for path in files if _typecode(path) == "F2TH"), files[-1])
    caption = f"Gappy {_typecode(shown)}: what was observed, and what two methods make of the rest."
    return (
        text
        + picture(shown.with_suffix(".png"), caption)
        + rows(["type", "hidden", *METHODS, "flights"], lines, words=2)
    )


def _flow(plan: StudyPlan, folder: Path, files: list[Path]) -> str:
    """The paper's appendix C."""
    frame = pl.DataFrame([{"typecode": _typecode(path), **json.loads(path.read_text())} for path in files])
    paper = frame.filter(flows=PAPER_SIZE[0], hidden=PAPER_SIZE[1]).select("typecode", paper="nll")
    frame = frame.join(paper, on="typecode").with_columns(gain=pl.col("nll") - pl.col("paper"))
    sizes = frame.select("flows", "hidden").unique().sort("flows", "hidden")
    gains: dict[int, dict[int, list[float]]] = {}
    lines: list[list[Cell]] = []
    for flows, hidden in sizes.iter_rows():
        at = frame.filter(flows=flows, hidden=hidden)
        gains.setdefault(flows, {})[hidden] = at["gain"].to_list()
        spread = _float(at["gain"].std()) or 0.0
        error = spread / len(at) ** 0.5
        cells = [number(_float(at["parameters"].mean())), number(_float(at["gain"].mean())), f"{error:.2g}"]
        lines.append([str(flows), str(hidden), *cells, f"{int((at['gain'] < 0).sum())} of {len(at)}"])
    head = ["flows", "hidden a weight", "parameters", "NLL less the paper's size's", "standard error", "better"]
    text = "<p>Masked affine flows of several sizes: held-out NLL (nats a flight) less that of the paper's size, "
    text += f"{PAPER_SIZE[0]} flows of {PAPER_SIZE[1]} hidden units a weight; means over types.</p>"
    return text + picture_of(png(flow_sizes_figure(gains)), "A dot is a type.") + rows(head, lines)


def _float(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
