"""Checks of a checkpoint's content: each part of its type, numbers finite, and the decoder flies."""

from collections.abc import Iterator
from math import isfinite
from typing import Any

import torch
from torch import Tensor

from descentflow.core.errors import CheckpointError
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.plausibility import Plausibility

OF_SCALE = ("thrust_n", "force_n", "cas_mps", "growth_per_mps")
"""Tensors of the scale of drag."""
TEXTS = ("model", "version", "representation.gaps")
DICTIONARIES = (
    "settings",
    *(f"representation.{name}" for name in ("decoder", "plausibility", "split", "provenance")),
    *(f"representation.decoder.{name}" for name in ("aircraft", "drag_scale", "drag_basis", "cas_basis", "residuals")),
)
TENSORS = (
    *(f"representation.decoder.{name}" for name in ("levels_fl", "weight_mean", "weight_scale")),
    *(f"representation.decoder.drag_scale.{name}" for name in OF_SCALE),
    *(f"representation.decoder.{basis}_basis.{name}" for basis in ("drag", "cas") for name in ("mean", "components")),
    *(f"representation.decoder.residuals.{name}" for name in ("drag", "speed", "weights", "numbers", "entry")),
)
"""Places of a checkpoint's section that are text, dictionaries and tensors."""
NAMES = {Tensor: "a tensor", dict: "a dictionary", str: "a text", list: "a list"}
"""Types as a reader knows them."""
MAY_BE_ABSENT = {"reference": dict, "context": list, "cleaning": dict, "air": dict, "seen_flights": dict}
"""Parts of a representation that it need not have, and their types."""
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
    kinds: tuple[tuple[tuple[str, ...], type], ...] = ((TEXTS, str), (DICTIONARIES, dict), (TENSORS, Tensor))
    for places, kind in kinds:
        for place in places:
            _check_type(_at(section, place), kind, place)
    representation = section["representation"]
    needed = {"gaps", *(place.split(".")[1] for place in DICTIONARIES[1:5])}
    if unknown := representation.keys() - needed - MAY_BE_ABSENT.keys():
        names = ", ".join(map(repr, sorted(map(str, unknown))))
        raise _wrong(f"the representation has {names}", ", ".join([*sorted(needed), *MAY_BE_ABSENT]))
    for part, of_part in MAY_BE_ABSENT.items():
        if representation.get(part) is not None:
            _check_type(representation[part], of_part, part)
    types = representation["provenance"].get("typecodes", [])
    if not isinstance(types, list | tuple) or not all(isinstance(code, str) for code in types):
        raise _wrong("typecodes of the provenance are no texts", "the types that the descents are of")
    for name, bound in representation["plausibility"].items():
        _check_type(bound, Tensor, f"plausibility.{name}")
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
        >>> from descentflow.densities.checkpoint import load_model
        >>> parts = load_model("best.ckpt").representation
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


def _check_type(value: Any, kind: type, place: str) -> None:
    if not isinstance(value, kind):
        raise _wrong(f"{place} is of type {type(value).__name__}", NAMES[kind])


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
