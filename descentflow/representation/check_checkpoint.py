"""Checks of a checkpoint's content: each part of its type, numbers finite, and the decoder flies."""

from collections.abc import Iterator
from math import isfinite
from typing import Any

import torch
from torch import Tensor

from descentflow.core.errors import CheckpointError
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.plausibility import Plausibility

PARTS: dict[str, tuple[type, ...]] = {
    "model": (str,),
    "settings": (dict,),
    "representation": (dict,),
    "version": (str,),
}
"""Parts of a checkpoint's section, and their types."""
OF_REPRESENTATION: dict[str, tuple[type, ...]] = {
    "decoder": (dict,),
    "plausibility": (dict,),
    "split": (dict,),
    "provenance": (dict,),
    "gaps": (str,),
    "reference": (dict, type(None)),
    "context": (list,),
    "cleaning": (dict, type(None)),
    "air": (dict, type(None)),
    "seen_flights": (dict, type(None)),
}
"""The same of its representation; the last five may be absent."""
OF_A_CONTEXT_COLUMN: dict[str, tuple[type, ...]] = {
    "name": (str,),
    "kind": (str,),
    "mean": (float, int),
    "scale": (float, int),
    "values": (list, tuple),
    "indicator": (bool,),
    "low": (float, int, type(None)),
    "high": (float, int, type(None)),
}
"""The same of a column of its context; the last two may be absent."""
OF_SCALE = ("thrust_n", "force_n", "cas_mps", "growth_per_mps")
DICTIONARIES = (
    "decoder.aircraft",
    "decoder.drag_scale",
    "decoder.drag_basis",
    "decoder.cas_basis",
    "decoder.residuals",
)
TENSORS = (
    "decoder.levels_fl",
    "decoder.weight_mean",
    "decoder.weight_scale",
    *(f"{DICTIONARIES[1]}.{name}" for name in OF_SCALE),
    *(f"{basis}.{name}" for basis in DICTIONARIES[2:4] for name in ("mean", "components")),
    *(f"{DICTIONARIES[4]}.{name}" for name in ("drag", "speed", "weights", "numbers", "entry")),
)
"""Tensors of the scale of drag; places of the representation that are dictionaries, and tensors."""
MAY_BE_ABSENT = ("reference", "context", "cleaning", "air", "seen_flights", "low", "high")
MAY_HAVE_GAPS = "reference"
"""Measurements of flights: not a number on unobserved levels."""
MEND = "take the file as `descentflow fit` wrote it, or fit again"
HIGHEST_FL = 700
MOST_WHOLE = 1 << 62
"""The largest whole number: of counts, seeds and numbers of context, which are of 64 bits."""


def check_section(section: dict[str, Any], state_dict: Any) -> None:
    """Refuse a checkpoint whose parts are of other types than they should be, or hold numbers that are not finite.

    Args:
        section: What descentflow keeps in a checkpoint.
        state_dict: Tensors of the trained module.

    Raises:
        CheckpointError: With the part that is wrong.

    Example:
        >>> content = torch.load("best.ckpt", weights_only=True)
        >>> check_section(content["descentflow"], content["state_dict"])
        >>> content["descentflow"]["representation"]["decoder"]["levels_fl"][3] = torch.nan
        >>> check_section(content["descentflow"], content["state_dict"])
        Traceback (most recent call last):
        descentflow.core.errors.CheckpointError: decoder.levels_fl holds 1 that is no finite number; ...
    """
    _check_types(section, PARTS, "section")
    representation = section["representation"]
    _check_types(representation, OF_REPRESENTATION, "representation")
    _check_known(representation, OF_REPRESENTATION, "the representation")
    types = representation["provenance"].get("typecodes", [])
    if not isinstance(types, list | tuple) or not all(isinstance(one, str) for one in types):
        raise _wrong("typecodes of the provenance are no texts", "the types that the descents are of")
    for column in representation.get("context", []):
        if not isinstance(column, dict):
            raise _wrong(f"a context column is of type {type(column).__name__}", "dictionaries")
        _check_types(column, OF_A_CONTEXT_COLUMN, "context column")
        _check_known(column, OF_A_CONTEXT_COLUMN, "a context column")
    bounds = tuple(f"plausibility.{name}" for name in representation["plausibility"])
    _check_version(representation["decoder"])
    for places, kind, name in ((DICTIONARIES, dict, "dictionary"), ((*TENSORS, *bounds), Tensor, "tensor")):
        for place in places:
            found = _at(representation, place)
            if not isinstance(found, kind):
                raise _wrong(f"{place} is of type {type(found).__name__}", f"a {name}")
    if not isinstance(state_dict, dict) or not all(isinstance(value, Tensor) for value in state_dict.values()):
        raise _wrong("state_dict is no dictionary of tensors", "the parameters of the model")
    kept = {name: value for name, value in representation.items() if name != MAY_HAVE_GAPS}
    for place, value in (*_leaves(kept), *_leaves(state_dict, "state_dict.")):
        wrong = _not_finite(value, or_unbounded=place.startswith("plausibility."))
        if wrong:
            raise _wrong(f"{place} holds {wrong} that is no finite number", "finite numbers")


def check_flies(decoder: DescentDecoder, plausibility: Plausibility) -> None:
    """Refuse a decoder that does not fly the mean of the training flights, or bounds of another grid.

    Raises:
        CheckpointError: If it does not.

    Example:
        >>> from descentflow.representation.read_checkpoint import load_representation
        >>> parts = load_representation("best.ckpt")
        >>> check_flies(parts.decoder, parts.plausibility)
    """
    levels = decoder.levels_fl
    rise = levels.dim() == 1 and len(levels) > 1 and bool((levels[1:] > levels[:-1]).all())
    if not rise or levels[0] < 0 or levels[-1] > HIGHEST_FL:
        raise _wrong("decoder.levels_fl does not rise", f"flight levels from 0 to {HIGHEST_FL}, each above the last")
    if not bool((decoder.weight_scale > 0).all()):
        raise _wrong("decoder.weight_scale is not positive", "standard deviations of the training flights' weights")
    residuals = decoder.residuals
    if not all(curves.dim() == 2 and curves.shape[1] == len(levels) for curves in (residuals.drag, residuals.speed)):
        raise _wrong("decoder.residuals is not on the grid", f"curves on {len(levels)} levels")
    of_flights = len(residuals.weights), decoder.dimension, residuals.n_numbers
    known = tuple(one.shape for one in (residuals.entry, residuals.weights, residuals.numbers))
    if known != (of_flights[:1], of_flights[:2], of_flights[::2]):
        raise _wrong("decoder.residuals has other flights", "weights and residual numbers of the same flights")
    if residuals.n_numbers and not of_flights[0]:
        raise _wrong("decoder.residuals has curves without a flight", "training flights")
    scale = decoder.drag_scale
    of_grid = all(getattr(scale, name).shape == levels.shape for name in OF_SCALE)
    if not of_grid or not bool((scale.force_n > 0).all()) or not scale.unit_n > 0:
        raise _wrong(
            "decoder.drag_scale is not of this grid", f"{len(levels)} thrusts, positive forces, CAS and slopes"
        )
    if plausibility.entry_counts.shape != levels.shape:
        raise _wrong("plausibility.entry_counts is not on the grid", f"{len(levels)} numbers of flights")
    mean = torch.zeros(1, decoder.dimension, dtype=torch.float64)
    with torch.no_grad():
        flown = decoder(mean)
        broken = plausibility.broken_rules(flown)
        plausibility.draw_entry(1, torch.Generator().manual_seed(0))
    curves = flown.drag_n, flown.cas_mps
    if flown.time_s.shape != (1, len(levels)) or len(broken) != 1 or not all(bool(c.isfinite().all()) for c in curves):
        raise _wrong("the decoder does not fly the mean weights", "bases on one grid of levels")


def _check_types(section: Any, kinds: dict[str, tuple[type, ...]], name: str) -> None:
    for part, kind in kinds.items():
        if part not in section:
            if part not in MAY_BE_ABSENT:
                raise _wrong(f"no {part} in the {name}", "all that a checkpoint of descentflow holds")
        elif not isinstance(section[part], kind) or (isinstance(section[part], bool) and bool not in kind):
            expected = " or ".join(one.__name__ for one in kind)
            raise _wrong(f"{part} of the {name} is of type {type(section[part]).__name__}", expected)


def _check_version(decoder: Any) -> None:
    """Refuse a decoder of earlier versions: on another scale of drag, or without its flights' residuals."""
    parts = decoder if isinstance(decoder, dict) else {}
    if "unit_n" not in (parts.get("drag_scale") or {}) or "residuals" not in parts:
        raise _wrong("a model of an earlier version", "decoder.drag_scale with a unit_n, and decoder.residuals")


def _check_known(section: dict[str, Any], kinds: dict[str, tuple[type, ...]], name: str) -> None:
    """Refuse parts that are not known: another version meant something by them."""
    if unknown := section.keys() - kinds.keys():
        raise _wrong(f"{name} has {', '.join(map(repr, sorted(map(str, unknown))))}", ", ".join(kinds))


def _at(tree: dict[str, Any], place: str) -> Any:
    for name in place.split("."):
        tree = tree.get(name) if isinstance(tree, dict) else None  # type: ignore[assignment]
    return tree


def _leaves(tree: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list | tuple) else None
    if entries is None:
        yield place.rstrip("."), tree
        return
    for key, value in entries:
        yield from _leaves(value, f"{place}{key}.")


def _not_finite(value: Any, *, or_unbounded: bool) -> int:
    """Count of numbers that are not finite; where bounds may be infinite, only NaN counts."""
    if isinstance(value, float):
        return int(not isfinite(value))
    if isinstance(value, int):
        return int(abs(value) > MOST_WHOLE)
    if not isinstance(value, Tensor) or not value.is_floating_point():
        return 0
    return int((value.isnan() if or_unbounded else ~value.isfinite()).sum())


def _wrong(got: str, expected: str) -> CheckpointError:
    return CheckpointError(got, expected=expected, mend=MEND)
