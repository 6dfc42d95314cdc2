"""Inputs of the killed commands: few flights on few levels, for the code that a kill meets is the same with many."""

import shutil
from pathlib import Path

import descentflow as df
from descentflow.simulation.days import simulate_days

FLIGHTS = 170
BOTTOM_FL = 320
"""Components are iterated level by level: a fit to descents from FL320 takes a third of the time of one from FL150."""
DAYS = 9
"""One more than the reference of a watch."""


def make(folder: Path) -> None:
    """Write rows, descents, others in warm air, days and a Gaussian into a folder, unless it is there as a whole.

    Args:
        folder: It gets ``rows.parquet``, ``descents.parquet``, ``warm.parquet``, ``plain.ckpt`` and ``days``.
    """
    if (folder / "whole").is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    df.simulate("A320", FLIGHTS, out=folder / "rows.parquet", seed=1)
    warm = df.simulate("A320", FLIGHTS, seed=2, plant={"temperature": {"deviation_k": 10.0}})
    descents = df.prepare(folder / "rows.parquet", bottom_fl=BOTTOM_FL, out=folder / "descents.parquet")
    df.prepare(warm, bottom_fl=BOTTOM_FL, out=folder / "warm.parquet")
    df.fit(descents, "gaussian", out=folder / "plain.ckpt")
    simulate_days("A320", 6 * DAYS, DAYS, folder / "days", seed=3)
    (folder / "whole").touch()
