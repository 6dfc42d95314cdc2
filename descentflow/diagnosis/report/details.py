"""What figures and careful readers need besides the answer."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from torch import Tensor

from descentflow.diagnosis.inference.likelihood import Contest
from descentflow.diagnosis.inference.selection import Chosen
from descentflow.diagnosis.inference.where import middles_fl

if TYPE_CHECKING:
    from descentflow.diagnosis.procedure import Diagnosis


def details_of(
    diagnosis: "Diagnosis",
    chosen: Chosen,
    test: Mapping[str, Any],
    shift: Tensor,
    counts: Mapping[str, int],
) -> dict[str, Any]:
    """What figures and careful readers need besides the answer."""
    contest = diagnosis.contest
    ladder = sorted(chosen.singles.items(), key=lambda item: -item[1].gain)
    return {
        "simulator": diagnosis.simulator.name,
        "regime": "anchored",
        "typecode": diagnosis.simulator.aircraft.typecode,
        "normal_from": diagnosis.source,
        "seed": diagnosis.seed,
        "quantities": list(diagnosis.compared.quantities()),
        "transition_fl": diagnosis.transition_fl,
        "mass_kg": diagnosis.compared.state.mass_kg,
        "test": dict(test),
        "discrepancy": {
            "explained_nats": chosen.outside.explained,
            "rest_nats": chosen.outside.rest,
            "rest_error_nats": chosen.outside.error,
            "share_explained": chosen.outside.share_explained,
            "named": chosen.outside.named,
        },
        "contest": [
            {
                "effect": name,
                "score_gain": c.gain,
                "error": c.error,
                "parameters": {
                    p.name: float(v)
                    for p, v in zip(diagnosis.catalogue[name].parameters, c.fit.theta[name], strict=True)
                },
            }
            for name, c in ladder
        ],
        "curves": curves(contest, shift),
        "flights": dict(counts),
    }


def curves(contest: Contest, shift: Tensor) -> dict[str, Any]:
    """Mean difference by band with its error, before and after, for the figures."""
    compared = contest.compared
    levels = middles_fl(compared)
    found: dict[str, Any] = {}
    for quantity in compared.quantities():
        at = compared.columns(quantity)
        y, left = compared.y[:, at], (compared.y - shift)[:, at]
        before, after = y[contest.real].nanmean(0), left[contest.real].nanmean(0)
        count = contest.real.sum().double()
        size = compared.scale[at] / count.sqrt()
        if contest.has_reference:
            other = y[~contest.real].nanmean(0).nan_to_num(0.0)
            before, after = before - other, after - other
            size = compared.scale[at] * (1 / count + 1 / (~contest.real).sum().double()).sqrt()
        bands = [compared.entries[i].band for i in at.tolist()]
        found[quantity] = {
            "level_fl": [levels[b] if b >= 0 else None for b in bands],
            "before": before.tolist(),
            "after": after.tolist(),
            "error": size.tolist(),
        }
    return found
