"""Whole files of every kind, made once, which the cases then damage."""

import importlib.util
import shutil
import sys
from pathlib import Path

import descentflow as df

TESTS = Path(__file__).resolve().parents[2] / "tests"
sys.path.insert(0, str(TESTS))
FLIGHTS = 150
TYPE = "A320"
SETTINGS = {
    "fit.yaml": (
        "model:\n  class_path: descentflow.training.models.Gaussian\n  init_args: {jitter: 1.0e-6}\n"
        "data: {seed: 1, validation_fraction: 0.1, split_by: flight}\ntrainer: {max_epochs: 1, logger: false}\n"
    ),
    "prepare.yaml": "bottom_fl: 150\nflight_gap_s: 900\nstale_s: 20\ncleared_speed_after_s: null\n",
    "given.csv": "entry_fl\n330\n340\n350\n",
    "types.csv": "icao24,typecode\n4ca001,A320\n4ca002,B738\n",
}


def make(folder: Path) -> None:
    """Write what the cases need into a folder, unless it is there as a whole.

    Args:
        folder: It gets rows and descents, others in warm air, three checkpoints (plain, with a context, corrected),
            ``gap.json``, settings, tables, EUROCONTROL's dummy aircraft in ``bada/`` and ``bada4/``, and a small file
            of every source in ``sources/``.
    """
    if (folder / "whole").is_file():
        return
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, text in SETTINGS.items():
        (folder / name).write_text(text)
    _flights_and_models(folder)
    _sources(folder / "sources")
    _bada(folder / "bada")
    (folder / "whole").touch()


def _flights_and_models(folder: Path) -> None:
    df.simulate(TYPE, FLIGHTS, out=folder / "rows.parquet", seed=1)
    warm = df.simulate(TYPE, FLIGHTS, seed=2, plant={"temperature": {"deviation_k": 10.0}})
    descents = df.prepare(folder / "rows.parquet", out=folder / "descents.parquet")
    df.fit(descents, "gaussian", out=folder / "plain.ckpt")
    df.fit(descents, "gaussian", context=["entry_fl"], out=folder / "context.ckpt")
    warmer = df.prepare(warm, out=folder / "warm.parquet")
    df.diagnose(warmer, folder / "plain.ckpt", out=folder / "gap")
    for made, name in (("gap.json", "gap.json"), ("corrected.ckpt", "corrected.ckpt")):
        shutil.copy(folder / "gap" / made, folder / name)


def _sources(folder: Path) -> None:
    """The small files that the tests damage by hand, one of each source."""
    from hostile_toys import SOURCES

    folder.mkdir()
    snapshots = SOURCES["aircraft-json"].splitlines()
    arranged = {"snapshots-list": b"[" + b", ".join(snapshots) + b"]", "snapshots-joined": b"".join(snapshots)}
    for name, content in {**SOURCES, **arranged}.items():
        (folder / name).write_bytes(content)


def _bada(folder: Path) -> None:
    """EUROCONTROL's dummy aircraft, which come with pyBADA (the extra `test`)."""
    package = importlib.util.find_spec("pyBADA")
    if package is not None and package.origin is not None:
        kept = shutil.ignore_patterns("*.PT*", "*.ATF", "*.OPT", "Dummy-PST", "Dummy-TWIN-plus")
        for family, own in (("BADA3", folder), ("BADA4", folder.with_name("bada4"))):
            shutil.copytree(Path(package.origin).parent / "aircraft" / family / "DUMMY", own, ignore=kept)
