"""Descents for a running simulator, one or many at a time, that meet what a controller asks: ``df.Generator``."""

import threading
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Annotated, Any, TypedDict, Unpack

import numpy as np
import polars as pl
import torch

from descentflow.core.arguments import Count, Numbered, Within, checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.threads import one_thread_where_they_spin
from descentflow.densities.checkpoint import as_density
from descentflow.densities.density import Density
from descentflow.generation._given_temperature import given_deviation_k, in_given_air
from descentflow.generation.conditional._conditioned_density import FreeTarget, conditioned_target
from descentflow.generation.conditional._draws import (
    Accepted,
    LatentTarget,
    NothingPlausible,
    accepted,
    corrected,
    judge_of,
)
from descentflow.generation.conditional._latent_density import LatentDensities
from descentflow.generation.conditional._nearest_plausible import implausible
from descentflow.generation.conditional.constraints import (
    Band,
    BySpeed,
    Constraint,
    DescentRequest,
    points_asked,
    speeds_asked,
)
from descentflow.generation.conditional.flown_so_far import FlownSoFar, flown_so_far
from descentflow.generation.sample_contexts import context_rows, entry_levels
from descentflow.generation.samples import GeneratedSamples, origin_of
from descentflow.representation.own_air import check_standard_air

NoiseMultiple = Annotated[float, Within(1e-4, 1e4)]
"""Of a variance: a hundredth of the noise, to a hundred times it."""
KEPT_REQUESTS = 256
"""Requests whose conditioned density is kept: what several flights are asked alike is conditioned once."""
_NUMBERING = threading.Lock()
"""Held while a generator takes its next numbers."""


class Asked(TypedDict, total=False):
    """Conditions of a request, see :meth:`Generator.next_batch`.

    Example:
        >>> asked: Asked = {"entry_fl": 330, "cas_kt": {200: 280}}
        >>> Generator("best.ckpt").next(**asked).asked
        ('entry at FL330', 'cas_kt 280 at FL200')
    """

    entry_fl: float | None
    cas_kt: BySpeed | None
    mach: BySpeed | None
    time_s: Band | None
    distance_nm: Band | None
    level: Band | None
    context: Mapping[str, Any] | pl.DataFrame | None
    flown: FlownSoFar | None
    number: int | None


class Generator:
    """Plausible descents that meet constraints, for a simulator that is running.

    Every descent has a number. Number, seed and constraints make it, and nothing else: it is the same whether it is
    drawn alone or in a batch, in whatever thread or process. :meth:`next` takes the next number, or the one it is
    given, for instance of a flight. Several threads may share one generator, and it can be pickled; processes that
    shall draw different descents take different seeds, or begin at different numbers.

    Args:
        model: A checkpoint's path, a density, or a fitted model.
        seed: The same seed gives the same descents.
        first: Number of the first descent.
        noise_multiple: Of the variance of the noise about the components where a part was flown.

    Raises:
        CheckpointError: If the checkpoint cannot be used.
        ConfigError: If drag was inferred in its flights' own air or at their own mass, the seed is no whole number, or
            the multiple of the noise is none.

    Example:
        >>> generator = Generator("best.ckpt", seed=0)
        >>> generator
        Generator of A320 descents, FL354 to FL150: seed 0, next 0
        >>> one = generator.next(entry_fl=330, cas_kt={200: 280}, time_s=(400, 600), level=160)
        >>> row = one.to_polars().filter(level_fl=200)
        >>> round(row["CAS"][0], 3), len(generator.next_batch(10, entry_fl=330))
        (280.0, 10)
    """

    @checked_arguments
    def __init__(
        self, model: object, *, seed: int = 0, first: Numbered = 0, noise_multiple: NoiseMultiple = 1.0
    ) -> None:
        """Compute once what no draw changes."""
        density = as_density(model)
        check_standard_air(density.representation, "a generator of single descents")
        if density.device.type != "cpu":
            density = deepcopy(density).cpu()
        self.density: Density = density
        self.representation = density.representation
        self.seed, self.noise_multiple = seed, noise_multiple
        self.decoder, self.bounds = self.representation.decoder, self.representation.plausibility
        self.levels_fl: list[float] = self.decoder.levels_fl.cpu().tolist()
        self._next = first
        self.transition_fl = self.decoder.transition_fl
        self._latent = LatentDensities(density, seed)
        if density.n_context == 0 and density.mixture is not None:
            self._latent.before()
        self._targets: dict[tuple[Any, ...], LatentTarget] = {}

    def __repr__(self) -> str:
        """Of what it draws, and which descent is next."""
        bottom, top, typecode = self.levels_fl[0], self.levels_fl[-1], self.decoder.aircraft.typecode
        return f"Generator of {typecode} descents, FL{top:.0f} to FL{bottom:.0f}: seed {self.seed}, next {self._next}"

    def next(self, **asked: Unpack[Asked]) -> GeneratedSamples:
        """One descent: :meth:`next_batch` of one, which lists the constraints."""
        return self.next_batch(1, **asked)

    @checked_arguments
    @one_thread_where_they_spin()
    def next_batch(
        self,
        n: Count,
        *,
        entry_fl: float | None = None,
        cas_kt: BySpeed | None = None,
        mach: BySpeed | None = None,
        time_s: Band | None = None,
        distance_nm: Band | None = None,
        level: Band | None = None,
        context: Mapping[str, Any] | pl.DataFrame | None = None,
        flown: FlownSoFar | None = None,
        number: Numbered | None = None,
    ) -> GeneratedSamples:
        """``n`` descents of the same constraints: those of n calls of :meth:`next`, to the last digits.

        Every value may be a pair of the least and the greatest allowed, None for an open side.

        Args:
            n: How many.
            entry_fl: Flight level of entry, the nearest of the grid. If absent, the context's ``entry_fl`` where it has
                one, else drawn as the training flights entered, given what else is asked.
            cas_kt: CAS (kt) half way down from the transition, or the entry if it is lower, to the lowest level; or
                values by flight level, ``{250: 290, 200: (270, 280)}``.
            mach: Mach number at the level of entry; or values by flight level.
            time_s: Seconds from entry to ``level``.
            distance_nm: NM through still air from entry to ``level``, in place of a time.
            level: Where ``time_s`` or ``distance_nm`` holds; a pair of them for a level within a band at one time.
            context: For a conditional model: values by name, or a table of one row. Where it has ``deviation_k``, TAS
                and distances are those of that temperature.
            flown: Levels flown so far (``level_fl``, ``CAS`` in kt, ``vertical_rate`` in ft/min). The descent goes on
                from the lowest of them, where its time and distance are zero.
            number: Of the first descent, in place of the next; of a callsign ``zlib.crc32(text.encode())``.

        Raises:
            ImplausibleError: If no descent of the model meets a constraint; it names the nearest value of 1,000 draws.
            ConfigError: If constraints contradict each other or the model, or have no such units.
            DataError: If what was flown cannot be used.
            SamplingError: If descents that meet all constraints together are too rare.

        Example:
            >>> alone, together = Generator("best.ckpt", seed=1), Generator("best.ckpt", seed=1)
            >>> apart = [alone.next(entry_fl=300, mach=0.76).trajectories.time_s for _ in range(3)]
            >>> torch.allclose(torch.cat(apart), together.next_batch(3, entry_fl=300, mach=0.76).trajectories.time_s)
            True
        """
        request, contexts = self._request(entry_fl, context, flown)
        request = replace(
            request,
            speeds=(
                *speeds_asked("mach", mach, -1, self.levels_fl),
                *speeds_asked("cas_kt", cas_kt, self._cas_level(request.entry), self.levels_fl),
            ),
            points=points_asked(time_s, distance_nm, level),
        )
        if request.goes_on and any(speed.level < 0 for speed in request.speeds):
            raise ConfigError(
                f"mach {mach!r} at the level of entry, which was flown",
                expected="a level that is still to be flown",
                mend="write mach={level: value}",
            )
        request.check(self.levels_fl)
        if self.representation.correction is not None and not request.is_free:
            raise ConfigError(
                "constraints for a corrected checkpoint, whose correction changes descents after they are drawn",
                expected="an entry level and a context alone",
                mend="draw more and keep those that meet the constraints, or take the checkpoint before correction",
            )
        with _NUMBERING:
            if number is None:
                number, self._next = self._next, self._next + n
        numbers = np.arange(number, number + n)
        drawn = self._accepted(request, numbers)
        descents = corrected(self.representation, self.seed, drawn.flown, numbers)
        return GeneratedSamples(
            drawn.u[:, : self.decoder.dimension].clone(),
            in_given_air(descents, torch.full((n,), request.deviation_k)),
            drawn.report,
            contexts,
            origin=origin_of(self.density, self.seed),
            asked=request.words(self.levels_fl),
            first=number,
            effective=drawn.effective,
            proposals=drawn.proposals,
        )

    def _request(
        self, entry_fl: float | None, context: Mapping[str, Any] | pl.DataFrame | None, flown: FlownSoFar | None
    ) -> tuple[DescentRequest, pl.DataFrame]:
        """Entry, context and what was flown."""
        contexts = context_rows(context, self.representation.context)
        if len(contexts) > 1:
            raise ConfigError(f"{len(contexts)} contexts", expected="one for a call", mend="call once for each context")
        key = tuple((name, str(contexts[name][0])) for name in contexts.columns)
        encoded = self.representation.context.encode(contexts)
        request = DescentRequest(
            key=key, context=encoded, deviation_k=float(given_deviation_k(self.representation, encoded)[0])
        )
        if flown is not None:
            if entry_fl is not None:
                raise ConfigError("entry_fl next to what was flown", expected="one of them", mend="leave entry_fl out")
            so_far = flown_so_far(self.decoder, flown, self.bounds)
            if bool(so_far.mask[0, 0]):
                raise ConfigError(
                    f"a descent flown to FL{self.levels_fl[0]:.0f}, the model's lowest level",
                    expected="a level left to descend to",
                    mend="give the levels of an earlier moment",
                )
            return replace(request, flown=so_far, entry=int(so_far.mask[0].to(torch.int8).argmax())), contexts
        entry = entry_levels(self.representation, contexts, entry_fl)
        return replace(request, entry=int(entry[0])) if len(entry) else request, contexts

    def _cas_level(self, entry: int) -> int:
        """Half way down the part flown at constant CAS."""
        middle = (self.levels_fl[0] + min(self.levels_fl[entry], self.transition_fl)) / 2
        return int((self.decoder.levels_fl - middle).abs().argmin())

    def _accepted(self, request: DescentRequest, numbers: np.ndarray) -> Accepted:
        try:
            return accepted(
                self._target(request),
                self.seed,
                numbers,
                judge_of(self.representation, self.seed, flown=request.goes_on),
            )
        except NothingPlausible as error:
            asked: list[Constraint] = [*request.speeds, *request.points]
            unmet = asked[-1:] if error.culprit is None else [error.culprit]
        if not unmet:
            raise ConfigError(
                "; ".join(request.words(self.levels_fl)) or "no constraint at all",
                expected="a level of entry or a context from which some draws are plausible",
                mend="choose one like those of the training flights",
            )

        raise implausible(request, unmet[0], lambda rest, n: self._accepted(rest, np.arange(n)).flown, self.levels_fl)

    def _target(self, request: DescentRequest) -> LatentTarget:
        """The density given a request, kept for the next call that asks the same."""
        if request.flown is not None:
            after = self._latent.after(request.flown, request.context, self.noise_multiple)
            return conditioned_target(request, after, self.density)
        key = (request.entry, request.speeds, request.points, request.key)
        target = self._targets.get(key)
        if target is None:
            if len(self._targets) >= KEPT_REQUESTS:
                self._targets.clear()
            if request.is_free and self.density.mixture is None:
                target = FreeTarget(self.density, request)
            else:
                target = conditioned_target(request, self._latent.before(request.context), self.density)
            self._targets[key] = target
        return target

    def __getstate__(self) -> dict[str, Any]:
        """All but the densities that were conditioned."""
        return {**self.__dict__, "_targets": {}}
