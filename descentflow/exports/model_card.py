"""The card of a model: what it was made of, how good it is beside noise floors, and what it is not."""

from collections.abc import Iterable
from math import isfinite
from pathlib import Path

from descentflow.core.errors import DataError
from descentflow.core.files import check_output, whole_file
from descentflow.core.version import __version__
from descentflow.densities.density import Density
from descentflow.evaluation.metrics.score_table import Score

BEGIN, END = "<!-- scores -->", "<!-- end of scores -->"
"""What :func:`fill_in_scores` replaces stands between these."""


def model_card(density: Density, name: str) -> str:
    """A card in Markdown; scores are still to be filled in.

    Args:
        density: The model.
        name: Of the file that it describes.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> print(model_card(load_model("best.ckpt"), "a320.safetensors"))
        # Descents of the A320
        ...
        | flights | 86 train, 10 validation, 24 test; their identifiers, aircraft and times are in... |
        ...
    """
    parts = density.representation
    decoder, split, made = parts.decoder, parts.split, parts.provenance
    levels = decoder.levels_fl
    period = made.get("period")
    facts = {
        "file": f"`{name}`, written by descentflow {__version__}",
        "model": f"{type(density).__name__}, {decoder.dimension} weights of drag and CAS",
        "type": ", ".join(made.get("typecodes", [])) or decoder.aircraft.typecode,
        "coefficients": f"{decoder.aircraft.typecode}: {decoder.aircraft.source}",
        "data": f"{made.get('descents', 'unknown: say it here')}",
        "period": " to ".join(period) if period else "not kept in the checkpoint: say it here",
        "flights": f"{len(split.train):,} train, {len(split.validation):,} validation, {len(split.test):,} test; their "
        "identifiers, aircraft and times are in the file",
        "levels": f"FL{levels[0]:.0f} to FL{levels[-1]:.0f}",
        "context": "none" if parts.context is None else parts.context.describe(),
        "licence": "not said yet: whoever publishes the model says it here, for the model and for its data",
    }
    table = "\n".join(f"| {key} | {value} |" for key, value in facts.items())
    return f"""# Descents of the {decoder.aircraft.typecode}

| | |
|---|---|
{table}

## Scores

{BEGIN}
Not evaluated yet. This fills them in, from flights that the model has not seen:
`descentflow evaluate {name} --real descents.parquet --out evaluation --card CARD.md`
{END}

## Limits

- Free descents of single flights between these levels: no level-offs, no controllers, no climbs.
- Drag is inferred with the coefficients above, so whatever they leave out is in it; with open coefficients neither drag
  nor nominal rates are EUROCONTROL's. Rates and times are those of the training flights.
- It knows the airspace, the season and the operators of its training flights and no others.
- Draws outside of the range of the training flights are rejected: rarer descents do not occur.
"""


def fill_in_scores(card: str | Path, rows: Iterable[Score], flights: int, real: str) -> None:
    """Put scores beside their noise floors into a card, in place of what stood there.

    Args:
        card: A card of :func:`model_card`.
        rows: Scores; those without a noise floor are left out.
        flights: Held-out flights behind them.
        real: Name of their file.

    Raises:
        DataError: If the card cannot be read, or has no place for scores.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> from descentflow.evaluation.evaluate import evaluate
        >>> _ = Path("card.md").write_text(model_card(load_model("best.ckpt"), "a320.safetensors"))
        >>> found = evaluate("best.ckpt", "descents.parquet", n=200)
        >>> fill_in_scores("card.md", found.scores, len(found.real), "descents.parquet")
        >>> "Not evaluated yet" in Path("card.md").read_text()
        False
    """
    before, after = check_card(card)
    lines = [
        f"| {row.quantity} | {row.statistic} | {row.unit} | {row.equal_size:.3g} | {row.floor:.3g} | "
        f"{row.floor_high:.3g} |"
        for row in rows
        if isfinite(row.equal_size) and isfinite(row.floor)
    ]
    text = "\n".join(
        [
            BEGIN,
            f"Against {flights:,} held-out flights of {real}. Samples are compared with as many flights as the noise "
            "floor compares flights with flights; below its 95th percentile they are no further from the flights than "
            "flights may be by chance.",
            "",
            "| quantity | statistic | unit | samples | noise floor | its 95th percentile |",
            "|---|---|---|---|---|---|",
            *lines,
            END,
        ]
    )
    with whole_file(card) as temporary:
        temporary.write_text(before + text + after, encoding="utf-8")


def check_card(card: str | Path) -> tuple[str, str]:
    """Refuse a card that scores cannot be filled into, before minutes of work go into them.

    Returns:
        What stands before the scores, and what after them.

    Raises:
        DataError: As :func:`fill_in_scores`.

    Example:
        >>> check_card("rows.parquet")
        Traceback (most recent call last):
        ...
        descentflow.core.errors.DataError: card rows.parquet is no text; expected a model card; ...
    """
    try:
        before, _, rest = Path(card).read_text(encoding="utf-8").partition(BEGIN)
    except OSError as error:
        raise DataError(f"card {card}: {error.strerror}", expected="a model card", mend="check the path") from error
    except UnicodeDecodeError as error:
        raise DataError(f"card {card} is no text", expected="a model card", mend="check the path") from error
    _, found, after = rest.partition(END)
    if not found:
        raise DataError(
            f"card {card} without {BEGIN} and {END}",
            expected="a card that `descentflow export --to safetensors` wrote",
            mend="put the two lines where the scores belong",
        )
    check_output(card)
    return before, after
