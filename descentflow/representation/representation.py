"""Bases, scaler, bounds and split: all that a density needs but itself."""

from dataclasses import asdict, dataclass
from typing import Any

from torch import Tensor, nn

from descentflow.air.kept_air import KeptAir
from descentflow.core.counter_random import FIRST_DRAWS, DrawNumbers
from descentflow.representation.context import NO_COLUMNS, ContextEncoder
from descentflow.representation.correction import Correction
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.decoder.trajectories import Trajectories
from descentflow.representation.evidence import Gaps
from descentflow.representation.plausibility import Plausibility
from descentflow.representation.seen_flights import NO_FLIGHTS, SeenFlights
from descentflow.surveillance.cleaning.thresholds import Cleaning, kept_cleaning


@dataclass(frozen=True)
class Split:
    """Flight identifiers of the three parts; no flight is in two of them.

    Example:
        >>> Split.from_state(Split(("a",), ("b",), ("c",)).to_state()).validation
        ('b',)
    """

    train: tuple[str, ...]
    validation: tuple[str, ...]
    test: tuple[str, ...]

    def describe(self) -> str:
        """Flights that a model of this split was fitted to, in words.

        Example:
            >>> print(Split(("a",), ("b",), ("c",)).describe())
            1 of 3 flights (1 for validation and 1 for test held out)
            >>> print(Split(("a", "b", "c"), (), ()).describe())
            all 3 flights, none held out
        """
        trained, of_validation, of_test = map(len, (self.train, self.validation, self.test))
        held = [f"{n:,} for {name}" for n, name in ((of_validation, "validation"), (of_test, "test")) if n]
        if not held:
            return f"all {trained:,} flights, none held out"
        return f"{trained:,} of {trained + of_validation + of_test:,} flights ({' and '.join(held)} held out)"

    def to_state(self) -> dict[str, list[str]]:
        """Lists of identifiers, for a checkpoint."""
        return {"train": list(self.train), "validation": list(self.validation), "test": list(self.test)}

    @classmethod
    def from_state(cls, state: dict[str, list[str]]) -> "Split":
        """Rebuild from :meth:`to_state`."""
        return cls(*(tuple(state[name]) for name in ("train", "validation", "test")))


class Representation(nn.Module):
    """Decoder, plausibility bounds and split: all that a latent model needs besides its own density.

    Example:
        >>> from descentflow.densities.checkpoint import load_model
        >>> parts = load_model("best.ckpt").representation
        >>> len(parts.split.train), parts.decoder.dimension
        (86, 4)
    """

    def __init__(
        self,
        decoder: DescentDecoder,
        plausibility: Plausibility,
        split: Split,
        provenance: dict[str, Any],
        reference: dict[str, Any] | None = None,
        context: ContextEncoder = NO_COLUMNS,
        cleaning: Cleaning | None = None,
        gaps: Gaps = "marginal",
        air: KeptAir | None = None,
        seen: SeenFlights = NO_FLIGHTS,
        correction: Correction | None = None,
    ) -> None:
        """Hold the parts.

        Args:
            decoder: Weights to descents.
            plausibility: Bounds and entry levels of the training flights.
            split: Which flights are in which part.
            provenance: Primitives that say where the descents came from.
            reference: What the training flights measured, in bands of altitude, by which a diagnosis holds other
                flights against them with the same instrument (:mod:`descentflow.measurements.quantities`); may be
                absent.
            context: Columns that the density is conditioned on; none by default.
            cleaning: Thresholds with which the training descents were cleaned, and with which rows are cleaned that the
                model is compared with; None if they are unknown.
            gaps: What the density is fitted to, see :func:`~descentflow.representation.linear_curves.evidence_of`.
            air: In which air drag was inferred, and the training flights' own; None for standard air.
            seen: By which training and validation flights are recognised under other identifiers; by their
                identifiers alone where that is empty.
            correction: Effects that a diagnosis found, which :meth:`fly` adds to decoded descents.
        """
        super().__init__()
        self.decoder, self.plausibility = decoder, plausibility
        self.split, self.provenance = split, provenance
        self.reference, self.context, self.cleaning, self.gaps = reference, context, cleaning, gaps
        self.air, self.seen, self.correction = air, seen, correction

    @property
    def n_context(self) -> int:
        """Numbers that stand for one flight's context; zero without one."""
        return self.context.width

    def fly(
        self,
        weights: Tensor,
        entry: Tensor | None = None,
        *,
        residual: Tensor | None = None,
        draws: DrawNumbers = FIRST_DRAWS,
    ) -> Trajectories:
        """Decode weights (n, d), with the effects of the correction if there is one.

        Args:
            weights: (n, d) standardised weights.
            entry: (n,) index of the entry level; the top of the grid if absent.
            residual: (n, r + s) residual numbers, see the decoder.
            draws: Seed and numbers of these draws, which determine the flights that a partial effect changes.

        Example:
            >>> from descentflow.densities.checkpoint import load_model
            >>> model = load_model("best.ckpt")
            >>> len(model.representation.fly(model.sample(4, seed=0)))
            4
        """
        flown: Trajectories = self.decoder(weights, entry, residual=residual)
        return flown if self.correction is None else self.correction.apply(self.decoder.aircraft, flown, draws)

    def to_state(self) -> dict[str, Any]:
        """Tensors and primitives from which :meth:`from_state` rebuilds the whole."""
        state: dict[str, Any] = {
            "decoder": self.decoder.to_state(),
            "plausibility": self.plausibility.to_state(),
            "split": self.split.to_state(),
            "provenance": self.provenance,
            "gaps": self.gaps,
        }
        if self.correction is not None:
            state["decoder"]["correction"] = self.correction.to_state()
        if self.air is not None:
            state["air"] = self.air.to_state()
        if self.seen is not NO_FLIGHTS:
            state["seen_flights"] = self.seen.to_state()
        if self.reference is not None:
            state["reference"] = self.reference
        if self.context.columns:
            state["context"] = self.context.to_state()
        if self.cleaning is not None:
            state["cleaning"] = asdict(self.cleaning)
        return state

    @classmethod
    def from_state(cls, state: dict[str, Any]) -> "Representation":
        """Rebuild from :meth:`to_state`."""
        corrected, cleaning = state["decoder"].get("correction"), kept_cleaning(state.get("cleaning"))
        return cls(
            DescentDecoder.from_state(state["decoder"]),
            Plausibility.from_state(state["plausibility"]),
            Split.from_state(state["split"]),
            state["provenance"],
            state.get("reference"),
            ContextEncoder.from_state(state.get("context", [])),
            cleaning,
            state["gaps"],
            None if state.get("air") is None else KeptAir.from_state(state["air"], len(state["decoder"]["levels_fl"])),
            SeenFlights.from_state(state["seen_flights"]) if "seen_flights" in state else NO_FLIGHTS,
            None if corrected is None else Correction.from_state(corrected, cleaning),
        )
