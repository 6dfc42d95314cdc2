"""The public calls with arguments that are right and cheap, of which the cases make some wrong."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from inspect import signature
from pathlib import Path
from typing import Any

import polars as pl
import torch

import descentflow as df
from descentflow.positions.ground_plan import Ground
from descentflow.training.data_settings import DataSettings

END = {"end": (51.5, -0.5), "track": 270.0}
TYPE = "A320"


@dataclass(frozen=True)
class Call:
    """A public function or method.

    Attributes:
        function: It.
        right: Arguments that it takes.
    """

    function: Callable[..., Any]
    right: dict[str, Any]

    @property
    def parameters(self) -> list[str]:
        """Names of all that can be given, but for the rest of :class:`descentflow.DescentDataModule` in `fit`."""
        names = [name for name in signature(self.function).parameters if name not in ("self", "data_options", "asked")]
        together = {"ground": Ground.__annotations__, "settings": vars(DataSettings())}
        return [key for name in names for key in together.get(name, [name])]


@cache
def calls(good: Path) -> dict[str, Call]:
    """Every public call by name: the functions and classes of the package, and methods of what they return.

    Args:
        good: Folder of whole files (:func:`fuzzing.good_files.make`).
    """
    rows, descents, plain = (good / name for name in ("rows.parquet", "descents.parquet", "plain.ckpt"))
    few = pl.read_parquet(rows).filter(pl.col("flight_id").rank("dense") <= 50)
    few_descents = df.prepare(few, typecode=TYPE)
    density = df.load(plain)
    functions = {
        "DescentDataModule": Call(_set_up, {"descents": descents}),
        "Gaussian": Call(df.Gaussian, {}),
        "GaussianMixture": Call(df.GaussianMixture, {}),
        "Generator": Call(df.Generator, {"model": density}),
        "MaskedAffineFlow": Call(df.MaskedAffineFlow, {}),
        "aircraft": Call(df.aircraft, {"typecode": TYPE}),
        "diagnose": Call(df.diagnose, {"real": good / "warm.parquet", "simulator": TYPE}),
        "evaluate": Call(df.evaluate, {"model": density, "real": descents, "n": 20, "n_splits": 2}),
        "export": Call(df.export, {"model": density, "to": "parquet", "path": "out.parquet", "n": 3}),
        "export to traffic": Call(
            df.export,
            {"model": density, "to": "traffic", "path": "out.parquet", "n": 3, "end_time": "2026-11-22", **END},
        ),
        "fit": Call(df.fit, {"descents": descents, "model": "gaussian"}),
        "load": Call(df.load, {"path": plain}),
        "predict": Call(df.predict, {"model": density, "descents": few_descents, "from_fl": 290, "n": 50}),
        "prepare": Call(df.prepare, {"rows": few}),
        "prepare to a file": Call(df.prepare, {"rows": few, "out": "out.parquet"}),
        "read_descents": Call(df.read_descents, {"path": descents}),
        "sample": Call(df.sample, {"model": density, "n": 3}),
        "sample of contexts": Call(df.sample, {"model": good / "context.ckpt", "n": 3, "context": {"entry_fl": 340}}),
        "simulate": Call(df.simulate, {"aircraft": TYPE, "n_flights": 1}),
        "simulate to files": Call(df.simulate, {"aircraft": TYPE, "n_flights": 1, "out": "out.parquet"}),
    }
    return functions | _methods(good, density, few_descents)


def _set_up(descents: Any, **options: Any) -> None:
    """Set up a DataModule, which reads then what it is asked for."""
    df.DescentDataModule(descents, **options).setup()


_set_up.__signature__ = signature(df.DescentDataModule)  # type: ignore[attr-defined]


def _methods(good: Path, density: Any, few_descents: Any) -> dict[str, Call]:
    """Of what the functions return."""
    samples = df.sample(density, 3)
    ahead = df.predict(density, few_descents, 290, n=50)
    scores = df.evaluate(density, good / "descents.parquet", n=20, n_splits=2)
    generator = df.Generator(density)
    flown = {"level_fl": [340, 330], "CAS": [270.0, 275.0], "vertical_rate": [-2000.0, -2000.0]}
    next_ones = {"n": 1, "entry_fl": 330}
    weights = density.sample(2, seed=0)
    return {
        "Generator.next_batch": Call(generator.next_batch, next_ones),
        "Generator.next_batch by point": Call(
            generator.next_batch, {**next_ones, "cas_kt": {200: 280}, "time_s": (400, 600), "level": 160}
        ),
        "Generator.next_batch after flown": Call(generator.next_batch, {"n": 1, "flown": flown}),
        "Samples.placed": Call(samples.placed, END),
        "Samples.write": Call(samples.write, {"path": "out.csv"}),
        "Samples.figure": Call(samples.figure, {}),
        "Prediction.placed": Call(ahead.placed, END),
        "Prediction.write": Call(ahead.write, {"path": "out.csv"}),
        "Evaluation.write": Call(scores.write, {"folder": "out", "figures": False}),
        "World.write": Call(df.simulate(TYPE, 1).write, {"out": "out.parquet"}),
        "Aircraft.with_factors": Call(df.aircraft(TYPE).with_factors, {}),
        "DescentDataModule.flights": Call(_module(good / "descents.parquet").flights, {"part": "test"}),
        "Density.sample": Call(density.sample, {"n": 2, "seed": 0}),
        "Density.log_prob": Call(density.log_prob, {"weights": torch.as_tensor(weights)}),
    }


def _module(descents: Path) -> df.DescentDataModule:
    data = df.DescentDataModule(descents)
    data.setup()
    return data
