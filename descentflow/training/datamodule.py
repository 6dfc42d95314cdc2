"""The one DataModule: splits by flight, fits the representation on the train part, serves what flights show."""

from copy import copy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl
from jsonargparse.typing import PositiveFloat
from lightning.pytorch import LightningDataModule, Trainer
from lightning.pytorch.utilities import rank_zero_info
from torch import Tensor
from torch.utils.data import DataLoader

from descentflow.air.kept_air import KeptAir
from descentflow.air.standard_air import in_standard_air
from descentflow.core.arguments import checked_arguments
from descentflow.core.errors import ConfigError
from descentflow.core.progress import Stage
from descentflow.core.progress import stage as progress_stage
from descentflow.core.row_runs import first_rows
from descentflow.densities.checkpoint import load_model
from descentflow.measurements.quantities import reference_state
from descentflow.physics.performance_model import PerformanceModel
from descentflow.representation.airspeed_error import AirspeedErrors, without_airspeed_error
from descentflow.representation.context import ContextEncoder
from descentflow.representation.context_columns import without_missing
from descentflow.representation.encode_flights import (
    EncodedFlights,
    context_of,
    encode_flights,
    encode_parts,
    summary_of,
)
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.fit_representation import fit_representation
from descentflow.representation.flight_parts import PARTS, Part, levels_shown, one_part, places, top_level, with_levels
from descentflow.representation.linear_curves import evidence_of
from descentflow.representation.own_air import MEASURED, STANDARD, airs_by, with_own_air
from descentflow.representation.profiles import Profiles, profiles_from_frame
from descentflow.representation.representation import Representation, Split
from descentflow.representation.seen_flights import SeenFlights
from descentflow.surveillance.descents.prepared_descents import Descents
from descentflow.surveillance.open_descents import FlightSource
from descentflow.training._chosen_descents import aircraft_of, at_mass, bottom_of, known_cleaning, name_of, of_typecodes
from descentflow.training.data_settings import DataSettings
from descentflow.training.splitting import SplitSettings, flight_batches, split_flights

FEWEST_AIRCRAFT = 10
"""Aircraft by which training flights are split again."""


class DescentDataModule(LightningDataModule):
    """Prepared descents as standardised weights, split by flight before anything is fitted.

    ``setup`` reads the descents, infers their drag, splits them, fits bases, scaler and bounds on the train part
    alone and encodes every part. With ``checkpoint`` nothing is fitted: the checkpoint's representation encodes
    the descents, its train and validation flights keep their part, and every other flight is a test flight.

    Example:
        >>> data = DescentDataModule("descents.parquet", aircraft="A320")
        >>> data.setup()
        >>> {part: len(data.profiles(part)) for part in ("train", "validation", "test")}
        {'train': 86, 'validation': 10, 'test': 24}
        >>> data.weights("train").std(0).round(decimals=6).unique()
        tensor([1.], dtype=torch.float64)
    """

    @checked_arguments
    def __init__(
        self,
        descents: list[Path] | Path | Descents,
        aircraft: str | None = None,
        bada_dir: Path | None = None,
        typecodes: str | list[str] | None = None,
        bottom_fl: int | None = None,
        mass_kg: PositiveFloat | None = None,
        air: str | Path = "standard",
        checkpoint: Path | None = None,
        **settings: Any,
    ) -> None:
        """Set the options; nothing is read before ``setup``.

        Args:
            descents: What ``prepare`` wrote: a file, a store, or a folder of files that were prepared alike; from
                Python also several such paths, or what it returned.
            aircraft: Type whose coefficients infer and fly the drag; the descents' own type if they have only one.
            bada_dir: Folder of BADA 3 or BADA 4; the embedded open aircraft if absent.
            typecodes: Keep these types of the descents (A320, or A320,A20N); all if absent.
            bottom_fl: Lowest level of the grid; the one that the descents were prepared with if absent.
            mass_kg: Mass that infers and flies the drag; the type's reference mass if absent.
            air: In which air drag is inferred: ``standard``; ``measured``: temperature and wind along the track by the
                flights' own reports (TAS, Mach, groundspeed); or a weather field by pressure level (ERA5), a NetCDF or
                GRIB file or a folder of them, read where the flights were. With a checkpoint: where the flights' air is
                known from, if not as its training flights' was.
            checkpoint: Encode with this checkpoint's representation instead of fitting one.
            **settings: Which flights are held out, how the others become weights, what the density is conditioned on,
                and batches, by the names of :class:`~descentflow.training.data_settings.DataSettings`.
        """
        super().__init__()
        self.descents, self.aircraft, self.bada_dir, self.typecodes = descents, aircraft, bada_dir, typecodes
        self.bottom_fl, self.mass_kg, self.air, self.checkpoint = bottom_fl, mass_kg, air, checkpoint
        self.settings = DataSettings(**settings)
        self._evidence: dict[Part, WeightEvidence] = {}
        self._representation: Representation | None = None
        self._grid: list[float] = []
        self._owner: dict[str, str] = {}
        self._parts: dict[Part, EncodedFlights] = {}

    def setup(self, stage: str | None = None) -> None:
        """Read, split, fit and encode, once (Lightning calls this with a stage).

        Raises:
            DataError: If the descents cannot be read or are too few.
            ConfigError: If they hold several types and no aircraft is named.
        """
        if self._representation is not None:
            return
        with progress_stage("reading descents", total=4, unit="steps") as done:
            if self.checkpoint is not None:
                representation = load_model(self.checkpoint).held_out_fit.representation.train()
                lowest_fl = float(representation.decoder.levels_fl[0])
                source = FlightSource(self.descents).for_model(representation.cleaning, lowest_fl)
                frame = of_typecodes(source, self.typecodes, name_of(self.descents))
                done.say("inferring drag")
                air = None if representation.air is None or self.air == STANDARD else self.air
                table = self.settings.context_table
                self._parts = encode_flights(frame, representation, table, air=air, say=rank_zero_info)
            else:
                representation = self._fitted(done)
        self._representation = representation
        rank_zero_info(summary_of(self._parts, representation))

    def of_all_flights(self) -> "DescentDataModule":
        """The same descents, options and levels, with no flight held out; not set up yet."""
        other = copy(self)
        other._grid = self.representation.decoder.levels_fl[[0, -1]].tolist()
        other.settings = replace(self.settings, test_fraction=0.0, validation_fraction=0.0)
        other._evidence, other._representation, other._parts = {}, None, {}
        return other

    def resplit(self, seed: int) -> "DescentDataModule":
        """The training flights alone, in the same components: a third of the aircraft for test, a tenth for validation.

        Args:
            seed: Of the split, which is of flights where there are only a few aircraft.
        """
        flights = self.flights("train")
        names = flights.profiles.flight_ids
        owners = [self._owner.get(name, name) for name in names]
        groups = owners if len(set(owners)) >= FEWEST_AIRCRAFT else names
        split = split_flights(names, groups, SplitSettings(1 / 3, seed=seed))
        other = copy(self)
        other._evidence = {}
        other._parts = {part: flights.subset(places(flights.profiles, split, part)) for part in PARTS}
        return other

    @property
    def representation(self) -> Representation:
        """Representation fitted on the train part."""
        if self._representation is None:
            raise ConfigError("a DataModule before setup", expected="setup() first", mend="call data.setup()")
        return self._representation

    @checked_arguments
    def flights(self, part: Part) -> EncodedFlights:
        """Profiles, weights and context of a part."""
        self.representation  # noqa: B018 - raises before setup
        return self._parts[part]

    def profiles(self, part: Part) -> Profiles:
        """Profiles of a part, on the grid."""
        return self.flights(part).profiles

    def weights(self, part: Part) -> Tensor:
        """Standardised weights (n, d) of a part, float64, gaps filled by their expectation."""
        return self.flights(part).weights

    def evidence(self, part: Part) -> WeightEvidence:
        """Evidence of a part's flights on their weights: what densities are fitted to and scored by."""
        if part not in self._evidence:
            self._evidence[part] = evidence_of(self.representation.decoder, self.profiles(part), self.settings.gaps)
        return self._evidence[part]

    def contexts(self, part: Part) -> Tensor:
        """Encoded context (n, c) of a part, float64; c is 0 where the density is not conditioned on any."""
        return self.flights(part).context

    def train_dataloader(self) -> DataLoader[Any]:
        """Training flights, shuffled by Lightning's seed."""
        return self._loader("train", shuffle=True)

    def val_dataloader(self) -> DataLoader[Any]:
        """Validation flights; the training flights where none were held out for validation."""
        return self._loader("validation" if len(self.profiles("validation")) else "train")

    def test_dataloader(self) -> DataLoader[Any]:
        """Test flights, of which `predict` takes the log-likelihood one by one."""
        return self._loader("test")

    predict_dataloader = test_dataloader

    def _loader(self, part: Part, *, shuffle: bool = False) -> DataLoader[Any]:
        evidence = self.evidence(part)
        size = self.settings.batch_size
        most = -(-len(evidence) // self.settings.fewest_batches) if shuffle else size
        return flight_batches(evidence, self.contexts(part), min(size, most), shuffle=shuffle)

    def _fitted(self, done: Stage) -> Representation:
        """The representation, fitted to the train part; all parts are encoded with it."""
        flights = self._read(done)
        done.say("fitting components")
        train = one_part(flights.profiles, flights.split, "train")
        fitted = fit_representation(
            train, flights.aircraft, flights.split, self.settings, mass_kg=self.mass_kg, **flights.known
        )
        done.say("encoding flights")
        self._parts = encode_parts(
            flights.profiles, flights.split, fitted.decoder, flights.contexts, fitted.context, rank_zero_info
        )
        return fitted

    def _read(self, done: Stage) -> "_FitFlights":
        """All that is wanted of the rows, which are let go then: a gigabyte for forty thousand flights."""
        source = FlightSource(self.descents).without_rows()
        frame = of_typecodes(source, self.typecodes, name_of(self.descents))
        done.say("inferring drag")
        asked = self.settings
        table = context_of(frame, asked.context or [], asked.context_table)
        frame = without_missing(frame, table, asked.missing_context, rank_zero_info)
        own_type = aircraft_of(frame, self.aircraft, self.bada_dir)
        provenance: dict[str, Any] = {
            "descents": name_of(self.descents),
            "typecodes": sorted(frame["typecode"].unique()),
            "period": Descents(frame, source.metadata).period,
        }
        cleaning = known_cleaning(source)
        # Not needed from here on: these texts are a quarter of the memory.
        frame = frame.drop("typecode", "callsign", strict=False)
        source = Descents(frame, source.metadata)
        profiles, split = self._fresh(frame, source, own_type)
        sizes = self.settings.wind_error_mps, self.settings.temperature_error_k
        if errors := AirspeedErrors.of(frame, *sizes):
            judges = places(profiles, split, "train")
            lines: list[str] = []
            profiles = without_airspeed_error(profiles, own_type, errors, judges, lines.append, self.mass_kg)
            provenance |= {"derived": len(errors.flight_ids & set(split.train)), "airspeeds": lines[0]}
            rank_zero_info(lines[0])
        shown, air = source.reported, None
        if self.air == STANDARD:
            profiles = self._on_the_grid(profiles, split)
        else:
            flown_by = at_mass(own_type, self.mass_kg)
            airs = airs_by(self.air, frame, profiles.levels_fl)
            all_levels = profiles.levels_fl
            profiles = with_own_air(profiles, flown_by, airs, rank_zero_info)
            if not airs.wind:
                rank_zero_info("no wind is known: drag is inferred in still air of the flights' own temperature")
            profiles = self._on_the_grid(profiles, split)
            # By reports, those that were computed from others say nothing.
            measured = self.air == MEASURED
            own = airs_by(MEASURED, shown, all_levels, wind=airs.wind) if measured else airs
            shown = in_standard_air(shown, flown_by, own, all_levels)
            trained = one_part(profiles, split, "train").air
            assert trained is not None
            air = KeptAir("measured" if measured else "field", airs.wind, trained)
        train = pl.col("flight_id").is_in(list(split.train))
        low, high = profiles.levels_fl[[0, -1]].tolist()
        known = {
            "provenance": provenance,
            "cleaning": cleaning,
            "air": air,
            "context": ContextEncoder.fit(table.filter(train), table.columns[1:], asked.missing_context),
            "reference": reference_state(shown, low, high, [*split.train, *split.validation]),
            "seen": SeenFlights.of(frame, split.train, split.validation),
        }
        return _FitFlights(profiles, split, table, own_type, known)

    def _on_the_grid(self, profiles: Profiles, split: Split) -> Profiles:
        return _on_levels_shown(profiles.between(*self._grid) if self._grid else profiles, split)

    def _fresh(self, frame: pl.DataFrame, source: Descents, own_type: PerformanceModel) -> tuple[Profiles, Split]:
        """Profiles up to the level that enough of the training flights reach, and the split made before."""
        bottom = bottom_of(source, frame, self.bottom_fl)
        owner = self._owner = dict(first_rows(frame.select("flight_id", "icao24"), "flight_id").iter_rows())

        profiles = profiles_from_frame(frame, own_type, bottom, mass_kg=self.mass_kg)
        groups = profiles.flight_ids if self.settings.split_by == "flight" else [owner[f] for f in profiles.flight_ids]
        split = split_flights(profiles.flight_ids, groups, self.settings)
        reached = top_level(profiles, places(profiles, split, "train"), self.settings.grid_top)
        top = max([reached, *self._grid[1:]])
        profiles = profiles.between(bottom, top)
        return with_levels(profiles, rank_zero_info), split


@dataclass(frozen=True)
class _FitFlights:
    """Flights of a fit.

    Attributes:
        profiles: On their grid.
        split: Into parts.
        contexts: A row of context for each.
        aircraft: Type by which their drag is inferred.
        known: What a representation holds besides what is fitted: its arguments by name.
    """

    profiles: Profiles
    split: Split
    contexts: pl.DataFrame
    aircraft: PerformanceModel
    known: dict[str, Any]


def _on_levels_shown(profiles: Profiles, split: Split) -> Profiles:
    """The flights on the levels that two training flights or more show."""
    whole = profiles.levels_fl
    ends = levels_shown(one_part(profiles, split, "train"))
    while ends != (float(profiles.levels_fl[0]), float(profiles.levels_fl[-1])):
        profiles = with_levels(profiles.between(*ends), rank_zero_info)
        # Flights that had one level left are gone, and with them maybe the second flight of a level.
        ends = levels_shown(one_part(profiles, split, "train"))
    if len(profiles.levels_fl) < len(whole):
        rank_zero_info(
            f"grid FL{ends[0]:.0f}-{ends[1]:.0f}, not FL{whole[0]:.0f}-{whole[-1]:.0f}: beyond it a level is shown by "
            "fewer than two training flights; more descents widen it"
        )
    return profiles


def data_of(trainer: Trainer) -> DescentDataModule:
    """The trainer's DataModule.

    Raises:
        ConfigError: If it has none, or one of something else than descents.

    Example:
        >>> data_of(Trainer(accelerator="cpu", logger=False))
        Traceback (most recent call last):
        descentflow.core.errors.ConfigError: a trainer without a DataModule; expected a DescentDataModule, ...
    """
    data: DescentDataModule | None = getattr(trainer, "datamodule", None)
    if data is None or not hasattr(data, "evidence"):
        raise ConfigError(
            f"a trainer {'without a DataModule' if data is None else f'with a {type(data).__name__}'}",
            expected="a DescentDataModule, which has the components of the flights next to their batches",
            mend='trainer.fit(model, datamodule=DescentDataModule("descents.parquet"))',
        )
    return data
