"""Small known things that several tests need: an aircraft, a representation, weights of known density."""

import signal
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import polars as pl
import torch
from lightning.pytorch import Callback, LightningDataModule, LightningModule, Trainer
from torch import Tensor
from torch.utils.data import DataLoader

from descentflow.aircraft_types.bada3.bada3_aircraft import Bada3Aircraft
from descentflow.core.units import FL_M, FPM_MPS, KT_MPS
from descentflow.densities.density import Density
from descentflow.physics.airspeed import cas_to_mach, mach_to_cas_mps
from descentflow.representation.decoder.descent_decoder import DescentDecoder
from descentflow.representation.drag_scale import DragScale
from descentflow.representation.evidence import WeightEvidence
from descentflow.representation.fit_representation import fit_representation
from descentflow.representation.fpca.basis import FunctionalBasis
from descentflow.representation.plausibility import Plausibility
from descentflow.representation.profiles import Profiles, drag_at_idle_n
from descentflow.representation.representation import Representation, Split
from descentflow.surveillance.cleaning.thresholds import Cleaning
from descentflow.surveillance.descents.prepared_descents import Descents, write_descents
from descentflow.training.models import LatentModel
from descentflow.training.splitting import flight_batches

AIRCRAFT = Bada3Aircraft(
    typecode="TOY", engine="jet", n_engines=2, wake_category="M", source="invented for tests",
    mass_reference_kg=64000.0, mass_minimum_kg=45000.0, mass_maximum_kg=78000.0, mass_payload_kg=18000.0,
    vmo_kt=350.0, mmo=0.82, altitude_maximum_ft=39000.0, altitude_mtow_ft=35000.0,
    altitude_mass_gradient_ft_kg=0.4, altitude_temperature_gradient_ft_k=-100.0,
    wing_area_m2=122.6, buffet_clbo=1.4, buffet_k=0.6,
    cd0_cr=0.024, cd2_cr=0.038, cd0_ic=0.025, cd2_ic=0.04, cd0_to=0.038, cd2_to=0.042, cd0_ap=0.038, cd2_ap=0.042,
    cd0_ld=0.096, cd2_ld=0.037, cd0_gear=0.031,
    vstall_cr_kt=140.0, vstall_ic_kt=115.0, vstall_to_kt=110.0, vstall_ap_kt=110.0, vstall_ld_kt=105.0,
    ct1=136000.0, ct2=52000.0, ct3=2.6e-11, ct4=10.0, ct5=0.008,
    ct_des_low=0.04, ct_des_high=0.045, altitude_des_ft=10000.0, ct_des_app=0.13, ct_des_ld=0.33,
    cf1=0.75, cf2=1000.0, cf3=14.0, cf4=50000.0, cf_cr=0.95,
    des_cas_low_kt=250.0, des_cas_high_kt=300.0, des_mach=0.78,
)  # fmt: skip


def flights(n: int, seed: int = 0, *, bottom_fl: int = 150, top_fl: int = 370, gappy: bool = True) -> Profiles:
    """Plausible descents: Mach then CAS near one of two schedules, a smooth rate, random entry levels."""
    generator = torch.Generator().manual_seed(seed)
    levels = torch.arange(bottom_fl, top_fl + 1, dtype=torch.float64)
    altitude_m = levels * FL_M

    def normal(*shape: int) -> Tensor:
        return torch.randn(shape, generator=generator, dtype=torch.float64)

    fast = torch.rand((n, 1), generator=generator) < 0.4
    cas = (torch.where(fast, 305.0, 275.0) + 5 * normal(n, 1)) * KT_MPS
    mach = 0.77 + 0.01 * normal(n, 1)
    cas = torch.minimum(cas.expand(n, len(levels)), mach_to_cas_mps(mach, altitude_m))
    position = (levels - bottom_fl) / (top_fl - bottom_fl)
    shape = 1 + 0.08 * normal(n, 1) + 0.05 * normal(n, 1) * position + 0.03 * normal(n, 1) * torch.sin(6 * position)
    rate = -(1800 + 500 * position) * shape * (cas / (290 * KT_MPS)) * FPM_MPS
    low = len(levels) // 2
    top = torch.randint(low, 2 * len(levels) - low, (n,), generator=generator).clamp(max=len(levels) - 1)
    mask = torch.arange(len(levels)) <= (top if gappy else torch.full_like(top, len(levels) - 1))[:, None]
    legs = -(altitude_m.diff() * 0.5 * (1 / rate[:, 1:] + 1 / rate[:, :-1]))
    time = torch.nn.functional.pad(legs.flip(1).cumsum(1).flip(1), (0, 1))
    drag = drag_at_idle_n(AIRCRAFT, cas, rate, altitude_m)
    return Profiles(tuple(f"toy-{seed}-{i:05d}" for i in range(n)), levels, time, cas, rate, drag, mask)


def representation(n: int = 300, seed: int = 0) -> Representation:
    """A representation fitted to toy flights, all of them called training flights."""
    train = flights(n, seed)
    return fit_representation(train, AIRCRAFT, Split(train.flight_ids, (), ()))


def normal(*shape: int, seed: int = 0) -> Tensor:
    """Standard normals of a seed, in double precision."""
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def newtons(levels: Tensor) -> DragScale:
    """The scale on which drag is what it is."""
    none = torch.zeros_like(levels)
    return DragScale(none, none + 1, none, none, 1.0, logarithm=False)


def representation_of(dimension: int) -> Representation:
    """A representation of exactly ``dimension`` weights, for densities that are tested on their own."""
    levels = torch.arange(150, 371, dtype=torch.float64)
    modes = torch.linalg.qr(torch.eye(len(levels), dtype=torch.float64)[:, :dimension]).Q.T / FL_M**0.5
    empty, zero, ones = torch.zeros(len(levels), 0), torch.zeros(()), torch.ones(dimension)

    def basis(mean: float, components: Tensor) -> FunctionalBasis:
        share = torch.full((len(components),), 1 / len(components))
        return FunctionalBasis(torch.full((len(levels),), mean), components, empty, zero, ones[0], share, FL_M)

    drag, cas = basis(40_000.0, modes[:-1]), basis(140.0, modes[-1:])
    decoder = DescentDecoder(AIRCRAFT, levels, drag, cas, newtons(levels), 0 * ones, ones)
    bound = torch.full((len(levels),), 1e9, dtype=torch.float64)
    plausibility = Plausibility(
        drag_low=-bound,
        drag_high=bound,
        cas_low=0 * bound,
        cas_high=bound,
        slowest_rate_mps=torch.tensor(-1e-3),
        entry_counts=torch.ones(len(levels), dtype=torch.long),
    )
    return Representation(decoder, plausibility, Split((), (), ()), {})


class WeightsModule(LightningDataModule):
    """Weights of known density, or what is known of them, in place of a DescentDataModule."""

    def __init__(
        self, train: Tensor | WeightEvidence, validation: Tensor | WeightEvidence, batch_size: int = 512
    ) -> None:
        super().__init__()
        self.parts = {"train": train, "validation": validation}
        self.batch_size = batch_size
        self.representation = representation_of(self.evidence("train").points.shape[1])

    def evidence(self, part: str) -> WeightEvidence:
        known = self.parts[part]
        return known if isinstance(known, WeightEvidence) else WeightEvidence.of_weights(known)

    def contexts(self, part: str) -> Tensor:
        return torch.zeros(len(self.evidence(part)), 0)

    def train_dataloader(self) -> DataLoader:
        return flight_batches(self.evidence("train"), self.contexts("train"), self.batch_size, shuffle=True)

    def val_dataloader(self) -> DataLoader:
        return flight_batches(self.evidence("validation"), self.contexts("validation"), 4096)


def fit(model: LatentModel, data: LightningDataModule, max_epochs: int, **settings: object) -> LatentModel:
    """Fit on the CPU without files or noise on the terminal."""
    data.setup("fit")
    data.representation.train()  # an earlier fit on the same data may have left it in evaluation mode
    quiet = {"logger": False, "enable_checkpointing": False, "enable_progress_bar": False, "accelerator": "cpu"}
    trainer = Trainer(
        max_epochs=max_epochs, num_sanity_val_steps=0, enable_model_summary=False, **{**quiet, **settings}
    )
    trainer.fit(model, datamodule=data)
    return model.eval()


class Opaque(Density):
    """A density that does not say of which kind it is."""

    def __init__(self, hidden: Density) -> None:
        super().__init__(hidden.dimension)
        self.hidden = hidden
        self.attach(hidden.representation)

    def log_prob(self, weights: Tensor, context: Tensor | None = None) -> Tensor:
        return self.hidden.log_prob(weights)

    def draw(self, n: int, generator: torch.Generator, context: Tensor | None = None) -> Tensor:
        return self.hidden.draw(n, generator)


def assert_equal(first: Density, second: Density) -> None:
    """The same parameters, buffers and representation, to the bit."""
    assert type(first) is type(second)
    ours, theirs = ({**one.state_dict(), **dict(one.representation.named_buffers())} for one in (first, second))
    assert [name for name in ours.keys() | theirs.keys() if not torch.equal(ours[name], theirs[name])] == []
    assert first.representation.split == second.representation.split
    assert first.representation.cleaning == second.representation.cleaning


def mean_nll(log_prob: Callable[[Tensor], Tensor], weights: Tensor) -> float:
    """Mean negative log-likelihood (nats a flight)."""
    with torch.no_grad():
        return -float(log_prob(weights).mean())


def write_descents_file(path: Path, n: int = 300, seed: int = 0, typecode: str = "A320", **settings: object) -> Path:
    """Toy flights as `descentflow prepare` would have written them; three flights to an aircraft."""
    real = flights(n, seed, **settings)
    rows, levels = (index.numpy() for index in torch.nonzero(real.mask, as_tuple=True))
    take = (rows, levels)
    frame = pl.DataFrame(
        {
            "flight_id": [real.flight_ids[i] for i in rows],
            "icao24": [f"{seed % 256:02x}{i // 3:04x}" for i in rows],
            "typecode": typecode,
            "level_fl": real.levels_fl.numpy()[levels].astype("int32"),
            "time_s": real.time_s.numpy()[take],
            "IAS": real.cas_mps.numpy()[take] / KT_MPS,
            "Mach": cas_to_mach(real.cas_mps, real.altitude_m).numpy()[take],
            "vertical_rate": real.rate_mps.numpy()[take] / FPM_MPS,
        }
    ).with_columns(timestamp=pl.lit(datetime(2026, 1, 1, tzinfo=UTC)) + pl.duration(seconds="time_s"))
    bottom = int(real.levels_fl[0])
    metadata = {"schema_version": 1, "bottom_fl": bottom, "top_fl": {typecode: 370}}
    metadata["settings"] = asdict(Cleaning(bottom_fl=bottom))
    write_descents(Descents(frame.sort("flight_id", -pl.col("level_fl")), metadata), path)
    return path


class NoRequeueing(Callback):
    """Refuse a fit that would write checkpoints at Slurm's signal."""

    def on_train_epoch_start(self, trainer: Trainer, pl_module: LightningModule) -> None:
        assert signal.getsignal(signal.SIGUSR1) is signal.SIG_DFL
