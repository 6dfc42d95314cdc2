"""Sample plausible descents from a fitted model: what `descentflow sample` calls."""

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import torch

from descentflow.air.level_air import LevelAir
from descentflow.core.arguments import Count, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.threads import one_thread_where_they_spin
from descentflow.densities.checkpoint import as_density
from descentflow.generation._given_temperature import given_deviation_k, in_given_air
from descentflow.generation.rejection import sample_descents
from descentflow.generation.sample_airs import Airs, airs_of
from descentflow.generation.sample_contexts import Contexts, context_rows, entry_levels
from descentflow.generation.samples import Samples, origin_of
from descentflow.positions.ground_plan import NOWHERE, GroundPlan
from descentflow.weather.weather_layout import names_weather

if TYPE_CHECKING:
    from descentflow.generation._air_along_path import AirAlongPath

QUANTITIES = 6
"""Of each descent at each level: time, CAS, Mach number, TAS, rate and drag."""


@checked_arguments
@one_thread_where_they_spin()
def sample(
    model: object,
    n: Count = 10_000,
    *,
    seed: int = 0,
    context: Contexts | None = None,
    entry_fl: float | Sequence[float] | None = None,
    air: Airs | None = None,
    plan: GroundPlan = NOWHERE,
    draw_budget: Count | None = None,
    progress: Callable[[int], None] | None = None,
) -> Samples:
    """Draw ``n`` descents that keep the bounds of the training flights (paper, section 2.4).

    Args:
        model: A checkpoint's path, a density, or a fitted model.
        n: Number of descents.
        seed: The same seed gives the same ``n`` descents, in any thread or process, and touches no other generator.
            Another ``n`` gives others; a :class:`~descentflow.Generator` numbers its descents.
        context: For a conditional model: values by name for all descents, or a table (in memory or as a path) with a
            row for each context; sample i has row i, beginning again after the last. Where it has ``deviation_k``
            (K from the standard atmosphere), TAS, groundspeed and distances are those of that temperature.
        entry_fl: Flight level where the descents start: one, several to draw from, or one for each row of
            ``context``. If absent, the context's ``entry_fl`` where it has one, else as the training flights entered.
        air: Air that they are flown in, see :func:`~.sample_airs.airs_of`: ``standard``, ``{"deviation_k": 10}``, a
            table by level, or ``training``: drawn from the training flights' own, which a model of drag in its flights'
            own air does if nothing is asked; or a weather field (NetCDF or GRIB file, or a folder), which is met along
            the plan's path.
        plan: Where they are flown, see :func:`descentflow.positions.ground_plan.ground_plan`; with a weather field it
            needs a path, and the time of its end where the field has several.
        draw_budget: Most draws; 100 for each descent wanted (at least 10,000) if absent.
        progress: Progress callback: called with the number of descents newly accepted.

    Returns:
        The samples: they print, convert to tables, and write themselves.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If ``n`` is not positive, or the context, the entry levels or the air do not fit the model, the air
            and the context both have a temperature, or the plan does not fit the weather field.
        DataError: If a table or a weather field cannot be read, or a descent leaves the field.
        SamplingError: If too few draws are plausible.

    Example:
        >>> samples = sample("best.ckpt", 200, seed=0, entry_fl=330)
        >>> len(samples), samples.to_polars()["level_fl"].max()
        (200, 330)
        >>> print(samples)
        200 samples from ... draws (... plausible...; broken: ...)
        levels FL150 to FL...; entry FL330 (FL330 to FL330); time to the lowest level ... min (...)
    """
    density = as_density(model)
    representation = density.representation
    _check_memory(n, len(representation.decoder.levels_fl))
    contexts = context_rows(context, representation.context)
    encoded, airs = representation.context.encode(contexts), airs_of(air, representation)
    with _along_path(air, plan) if names_weather(air) else nullcontext() as along:
        samples = sample_descents(
            density,
            representation,
            n,
            seed,
            context=encoded,
            entry=entry_levels(representation, contexts, entry_fl),
            air=airs if along is None else along.fly,
            draw_budget=draw_budget,
            progress=progress,
        )
        if along is not None:
            there = along.found(samples.trajectories)
            samples = replace(samples, air=there.air, flown_at=there.positions)
    given_k = given_deviation_k(representation, encoded)
    own_k = given_k[torch.arange(n) % len(given_k)]
    flown = in_given_air(samples.trajectories, own_k)
    own = None if samples.air is None else LevelAir(samples.air.deviation_k + own_k[:, None], samples.air.tailwind_mps)
    return replace(samples, trajectories=flown, air=own, context=contexts, plan=plan, origin=origin_of(density, seed))


@contextmanager
def _along_path(field: Any, plan: GroundPlan) -> "Iterator[AirAlongPath]":
    """The air of a weather field along a plan's path."""
    # Here: samples without a field need none of it.
    from descentflow.generation._air_along_path import AirAlongPath
    from descentflow.weather.weather_field import weather_field

    with weather_field(field) as opened:
        yield AirAlongPath(opened, plan)


def _check_memory(n: int, n_levels: int) -> None:
    """All samples are in memory together: more than the machine has of it end in hours without a word."""
    if not hasattr(os, "sysconf"):
        return  # Windows gives no more than it has, so that torch refuses at once
    each = n_levels * QUANTITIES * torch.float64.itemsize
    most = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // each
    if n > most:
        raise ConfigError(
            f"{n:,} descents of {n_levels} levels, {n * each / 1e9:,.0f} GB",
            expected=f"at most {most:,}, which the memory of this machine holds",
            mend="draw several times, each with a seed of its own",
        )
