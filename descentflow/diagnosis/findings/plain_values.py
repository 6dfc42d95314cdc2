"""Plain values of typed findings for `gap.json`, and numbers as readers like them."""

from dataclasses import fields, is_dataclass
from typing import Any

NOT_WRITTEN = {"json": None}
"""Metadata of fields that `gap.json` does not hold."""


def primitives(value: Any) -> Any:
    """Dictionaries, lists and plain values of typed findings: the content of `gap.json`.

    Fields of :data:`NOT_WRITTEN` are left out, others are written under the key in their metadata where it has one.

    Example:
        >>> from descentflow.diagnosis.findings.cause_found import ClosedShare
        >>> primitives(ClosedShare(0.78, 0.75, 0.81))
        {'estimate': 0.78, 'low': 0.75, 'high': 0.81}
    """
    if is_dataclass(value):
        plain = {}
        for field in fields(value):
            key = field.metadata.get("json", field.name)
            if key is not None:
                plain[key] = primitives(getattr(value, field.name))
        return plain
    if isinstance(value, dict):
        return {key: primitives(content) for key, content in value.items()}
    if isinstance(value, (list, tuple)):
        return [primitives(content) for content in value]
    return value


def number(value: float) -> str:
    """Three digits, without an exponent where a reader can do without.

    Example:
        >>> number(0.43219), number(27300.4)
        ('0.432', '27300')
    """
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def percent(share: float | None) -> str:
    """A share, or a dash.

    Example:
        >>> percent(0.784), percent(None), percent(-0.002)
        ('78 %', '-', '0 %')
    """
    text = "-" if share is None else f"{100 * share:.0f} %"
    return "0 %" if text == "-0 %" else text
