"""Description of an exported sampler for its user: inputs, outputs, units, bounds, and the draw of entry levels."""

from dataclasses import asdict
from typing import Any

from torch import Tensor

from descentflow.core.version import __version__
from descentflow.densities.density import Density
from descentflow.exports.columns import COLUMNS, FUEL
from descentflow.exports.descent_graph import ALL_RULES, PROFILES, Precision, SamplerGraph
from descentflow.representation.context import ContextColumn

FORMAT = "descentflow-sampler"
VERSION = 1
INPUTS = {
    "noise": "independent standard normals, from which the weights are made",
    "weights": "standardised weights of drag, then of CAS",
    "entry_fl": "flight level where the descent starts; the nearest level of the grid is taken",
    "neighbour": "a uniform number in [0, 1), which picks the training flight whose residual is taken",
    "uniform": "a uniform number in [0, 1), which picks the component of the mixture",
    "context": "the numbers that stand for the flight's context, see `context`",
}
"""Meaning of each input."""
BOUNDS = {"drag_n": ("drag_low", "drag_high"), "cas_mps": ("cas_low", "cas_high")}
"""Bound of the description -> buffers of :class:`~descentflow.representation.plausibility.Plausibility`."""
LIMITS = ("slowest_rate_mps", "fastest_change_mps2", "fastest_rate_change_mps2")
"""Bounds that are a buffer of the same name."""


def describe(density: Density, sampler: SamplerGraph, precision: Precision) -> dict[str, Any]:
    """The description of a sampler and its decoder, as primitives for a JSON document.

    Args:
        density: The model.
        sampler: Its exported modules.
        precision: Of inputs and outputs.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> model = load_model("best.ckpt")
        >>> made = describe(model, SamplerGraph(model), "float64")
        >>> made["inputs"]["sampler"]["noise"]["shape"], made["outputs"]["CAS"]["unit"], made["redraw"]
        (['n', 4], 'knot', 'noise, with the same entry_fl')
    """
    parts = density.representation
    levels_fl = parts.decoder.levels_fl
    counts = parts.plausibility.entry_counts.cpu().double()
    described: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"descentflow {__version__}",
        "typecode": parts.decoder.aircraft.typecode,
        "density": type(density).__name__,
        "precision": precision,
        "levels_fl": _numbers(levels_fl),
        "inputs": {
            "sampler": _inputs(sampler.example_inputs(1), precision),
            "decoder": _inputs(decoder_inputs(sampler, 1), precision),
        },
        "outputs": _outputs(sampler, precision),
        "rules": list(ALL_RULES),
        "bounds": {
            **{name: [_numbers(getattr(parts.plausibility, end)) for end in ends] for name, ends in BOUNDS.items()},
            **{name: _numbers(getattr(parts.plausibility, name)) for name in LIMITS},
        },
        "entry_share": _numbers(counts / counts.sum()),
        "redraw": sampler.draw.redraw,
    }
    if parts.n_context:
        described["context"] = [_context(column) for column in parts.context.columns]
    return described


def decoder_inputs(sampler: SamplerGraph, n: int) -> dict[str, Tensor]:
    """Inputs of the decoder for the descents of :meth:`SamplerGraph.example_inputs`, weights in place of noise.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> list(decoder_inputs(SamplerGraph(load_model("best.ckpt")), 3))
        ['weights', 'entry_fl', 'neighbour']
    """
    inputs = sampler.example_inputs(n)
    weights = sampler(**inputs)["weights"].detach()
    return {"weights": weights, **{name: inputs[name] for name in ("entry_fl", "neighbour") if name in inputs}}


def _inputs(example: dict[str, Tensor], precision: Precision) -> dict[str, Any]:
    return {name: _about(["n", *value.shape[1:]], precision, INPUTS[name]) for name, value in example.items()}


def _about(shape: list[Any], kind: str, meaning: str, **unit: str) -> dict[str, Any]:
    return {"shape": shape, "type": kind, **unit, "meaning": meaning}


IN_AIR = ("TAS", *FUEL, "distance_nm")
"""Outputs that the temperature of the air would change."""


def _outputs(sampler: SamplerGraph, precision: Precision) -> dict[str, Any]:
    n_levels = len(sampler.descents.decoder.levels_fl)
    air = ", in standard air whatever the temperature of the context" if sampler.n_context else ""
    profiles = {name: f"{COLUMNS[name].meaning}{air if name in IN_AIR else ''}" for name in PROFILES}
    return {
        "level_fl": _about([n_levels], precision, "flight levels, ascending", unit=COLUMNS["level_fl"].unit),
        **{
            name: _about(["n", n_levels], precision, f"{meaning}; NaN above the entry level", unit=COLUMNS[name].unit)
            for name, meaning in profiles.items()
        },
        "accepted": _about(["n"], "bool", "whether the draw keeps every rule; drop it if not"),
        "broken": _about(["n", len(ALL_RULES)], "bool", "which of `rules` the draw breaks"),
        "weights": _about(["n", sampler.dimension], precision, "standardised weights; an output of the sampler alone"),
    }


def _context(column: ContextColumn) -> dict[str, Any]:
    """A column of the context: how its value becomes numbers, in the order in which the input has them."""
    how = {
        "number": "(value - mean) / scale",
        "hour": "sin and cos of 2 pi value / 24",
        "category": "one 0/1 number for each of `values` but the first",
    }[column.kind]
    return {**asdict(column), "values": list(column.values), "becomes": how}


def _numbers(values: Tensor) -> Any:
    """As lists of numbers; infinite bounds, which no draw breaks, as None: JSON has no infinity."""
    plain = values.detach().cpu().double().tolist()
    listed = plain if isinstance(plain, list) else [plain]
    kept = [value if abs(value) != float("inf") else None for value in listed]
    return kept if isinstance(plain, list) else kept[0]
