"""Every draw has generators of its own: torch's global one is neither read nor moved, whatever other threads do."""

import ast
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch
from torch import Tensor
from torch.distributions import MultivariateNormal
from toys import normal, write_descents_file

import descentflow
from descentflow.densities import GaussianDensity, GaussianMixtureDensity, MaskedAffineFlowDensity
from descentflow.densities.density import Density
from descentflow.densities.mixture_parameters import Mixture

D = 4
CALLS = 2000


def mixture(n_context: int = 0) -> GaussianMixtureDensity:
    factors = (0.3 * normal(3, D, D).tril(-1) + torch.eye(D, dtype=torch.float64)).contiguous()
    line = (normal(3, D, n_context, seed=1), normal(3, n_context, seed=2)) if n_context else ()
    density = GaussianMixtureDensity(D, 3, n_context)
    density.mixture = Mixture(torch.tensor([0.5, 0.3, 0.2]).double(), 2 * normal(3, D, seed=3), factors, *line)
    return density


def gaussian(n_context: int = 0) -> GaussianDensity:
    density = GaussianDensity(D, n_context)
    density.scale_tril.data = (0.3 * normal(D, D).tril(-1) + torch.eye(D, dtype=torch.float64)).contiguous()
    if n_context:
        density.slope.data = normal(D, n_context, seed=1)
    return density


def flow(**settings: object) -> Density:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return MaskedAffineFlowDensity(D, **settings).eval()


def globally(seed: int, draw: Callable[[], Tensor]) -> Tensor:
    """Draw of a library by torch's global generator."""
    with torch.random.fork_rng(), torch.no_grad():
        torch.manual_seed(seed)
        return draw()


@pytest.mark.parametrize("n_context", [0, 2])
def test_weights_are_those_that_the_libraries_draw_by_the_global_generator(n_context: int) -> None:
    """To the bit: samples of before, which were drawn so, come back."""
    rows = normal(500, n_context, seed=7)
    context = (rows,) if n_context else ()
    mixed, one = mixture(n_context), gaussian(n_context)
    assert torch.equal(mixed.sample(500, 3, *context), globally(3, lambda: mixed.program(rows)))
    normals = MultivariateNormal(one.loc + rows @ one.slope.T, scale_tril=one.scale_tril)
    assert torch.equal(one.sample(500, 3, *context), globally(3, normals.sample))
    plain = flow(n_flows=2, n_context=n_context)
    single = tuple(one.float() for one in context)
    assert torch.equal(plain.sample(500, 3, *context), globally(3, lambda: plain.flow.sample(500, *single)[0].double()))


def test_four_threads_draw_what_one_draws() -> None:
    """2,000 calls, none of which may differ; before, 6 of 400 did."""
    densities = [gaussian(), mixture(), flow(n_flows=1)]
    # The flow's calls take hundreds of times longer.
    shares = [0.485, 0.485, 0.03]
    calls = [(k, seed) for k, share in enumerate(shares) for seed in range(int(CALLS * share))]
    assert len(calls) == CALLS

    def draw(call: tuple[int, int]) -> Tensor:
        return densities[call[0]].sample(3, call[1])

    serial = [draw(call) for call in calls]
    with ThreadPoolExecutor(4) as pool:
        threaded = list(pool.map(draw, calls))
    assert sum(not torch.equal(a, b) for a, b in zip(serial, threaded, strict=True)) == 0


FORKED = """
import multiprocessing, torch, descentflow
before = torch.get_num_threads()
(torch.ones(1000, 1000) @ torch.ones(1000, 1000)).sum()  # makes torch's threads, which a fork does not copy
def draw(seed):
    return float(torch.ones(100_000).exp().sum()), torch.get_num_threads()
with multiprocessing.get_context("fork").Pool(1) as pool:
    print(pool.map_async(draw, [0]).get(timeout=60)[0][1], torch.get_num_threads() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks by default")
def test_a_forked_process_does_not_wait_for_threads_that_it_has_not() -> None:
    environment = {**os.environ, "OMP_NUM_THREADS": "2"}
    folder = str(Path(descentflow.__file__).parents[1])
    words = [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED]
    done = subprocess.run(words, capture_output=True, text=True, check=True, env=environment, cwd=folder, timeout=120)
    assert done.stdout.split() == ["1", "0"], "the parent keeps its own"


FORKED_AFTER_POLARS = """
import multiprocessing, sys, descentflow, polars
def read(path):
    return descentflow.read_descents(path).flights
if __name__ == "__main__":
    polars.read_parquet(sys.argv[1]).sort("IAS")  # makes the threads of Polars
    for kind in "spawn", "fork":
        with multiprocessing.get_context(kind).Pool(1) as pool:
            print(pool.map_async(read, [sys.argv[1]]).get(timeout=60))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks by default")
def test_a_forked_process_refuses_tables_that_polars_would_wait_for(tmp_path: Path) -> None:
    descents = write_descents_file(tmp_path / "descents.parquet", 30)
    script = tmp_path / "forked.py"
    script.write_text(FORKED_AFTER_POLARS)
    environment = {**os.environ, "PYTHONPATH": str(Path(descentflow.__file__).parents[1])}
    words = [sys.executable, "-W", "ignore::DeprecationWarning", str(script), str(descents)]
    done = subprocess.run(words, capture_output=True, text=True, env=environment, timeout=120)
    assert done.stdout.startswith("[{'A320': ")
    assert done.stdout.count("\n") == 1, "only the process that was begun afresh answers"
    assert "a process begun afresh" in done.stderr


RANDOM = {"rand", "randn", "randint", "randperm", "multinomial", "normal", "bernoulli", "rand_like", "randn_like"}
MOVES_THE_GLOBAL_GENERATOR = {"manual_seed", "fork_rng", "seed_everything", "seed", "RandomState"}
TRAINS = {"training/fit.py", "training/final_fit.py", "densities/checkpoint.py"}
"""Fits seed what Lightning and initial parameters draw from; loading puts back what initial parameters drew."""


def test_no_code_draws_by_a_global_generator() -> None:
    calls = []
    package = Path(descentflow.__file__).parent
    for path in sorted(package.rglob("*.py")):
        name = path.relative_to(package).as_posix()
        for node in ast.walk(ast.parse(path.read_text())):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
                continue
            owner = ast.unparse(node.func.value)
            given = {keyword.arg for keyword in node.keywords}
            draws = owner == "torch" and node.func.attr in RANDOM and "generator" not in given
            moves = node.func.attr in MOVES_THE_GLOBAL_GENERATOR and owner in ("torch", "torch.random", "np.random")
            numpys = owner == "np.random" and node.func.attr not in (
                "default_rng",
                "Philox",
                "Generator",
                "SeedSequence",
            )
            if (draws or moves or numpys) and name not in TRAINS:
                calls.append(f"{name}:{node.lineno} {ast.unparse(node)[:60]}")
    assert not calls
