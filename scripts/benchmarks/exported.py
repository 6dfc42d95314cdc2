"""Size of exported samplers and their time in onnxruntime, against `sample`."""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import descentflow as df
from benchmarks.timing import print_row

FLIGHTS, EPOCHS = 300, 20
SIZES = (1, 100, 10_000)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare no option."""


def run(args: argparse.Namespace) -> None:
    """Print a row for each density: kB, and milliseconds of processor time by number of descents."""
    import onnxruntime

    descents = df.prepare(df.simulate("A320", FLIGHTS, seed=0))
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    print(f"onnxruntime {onnxruntime.__version__}, single precision, one thread, least of up to 8 calls, ms")
    print_row(["density", "kB", *(f"{n:,}" for n in SIZES), "ours"])
    with tempfile.TemporaryDirectory() as folder:
        for kind in ("gaussian", "mixture", "flow"):
            model = df.fit(descents, model=kind, max_epochs=EPOCHS if kind == "flow" else None)
            path = Path(folder, f"{kind}.onnx")
            df.export(model, "onnx", path, precision="float32")
            session = onnxruntime.InferenceSession(path, options)
            cells = [kind, f"{os.path.getsize(path) / 1000:.0f}"]
            cells += [f"{1000 * seconds(session, n):.2f}" for n in SIZES]
            ours = least_s(partial(df.sample, model, SIZES[-1], seed=0), 3)
            print_row([*cells, f"{1000 * ours:.0f}"])


def seconds(session: Any, n: int) -> float:
    """Least processor time of a call that flies n descents."""
    rng, feeds = np.random.default_rng(0), {}
    for asked in session.get_inputs():
        draw = rng.standard_normal if "noise" in asked.name else rng.random
        feeds[asked.name] = draw([n, *asked.shape[1:]], np.float32)
    feeds["entry_fl"] = np.full(n, 330, np.float32)
    return least_s(partial(session.run, None, feeds), 8 if n < SIZES[-1] else 3)


def least_s(work: Callable[[], object], repeats: int) -> float:
    """Least processor time of some calls, after one that does not count."""
    work()
    times = []
    for _ in range(repeats):
        started = time.process_time()
        work()
        times.append(time.process_time() - started)
    return min(times)
