"""To the end of its first step a fit loads the libraries of the model that it trains, and not those of the others."""

import subprocess
import sys
from pathlib import Path

import pytest

OPTIONAL = ("sklearn", "pyro", "normflows")
"""Large packages that only some of the models need."""
NEVER = ("pandas", "xarray", "distributed", "jsbsim", "onnx", "openap", "traffic")
"""Large packages that no fit of a flow or a Gaussian needs."""

FIRST_STEP = f"""
import os, sys
from lightning.pytorch import Callback

class FirstStep(Callback):
    def on_train_batch_end(self, *_):
        print("loaded", *(name for name in {(*OPTIONAL, *NEVER)!r} if name in sys.modules), flush=True)
        os._exit(0)
"""
"""A callback that lists what is loaded, and ends the process: scores and figures come later."""


@pytest.mark.parametrize(
    ("settings", "needed"),
    [
        pytest.param("gaussian", set(), marks=pytest.mark.slow),
        ("flow", {"normflows"}),
        pytest.param("gmm", {"sklearn", "pyro"}, marks=pytest.mark.slow),
        pytest.param("gmm_svi", {"sklearn", "pyro"}, marks=pytest.mark.slow),
    ],
)
def test_a_fit_loads_the_libraries_of_its_model_alone(
    settings: str, needed: set[str], descents: Path, tmp_path: Path
) -> None:
    (tmp_path / "first_step.py").write_text(FIRST_STEP)
    words = ["fit", "--config", settings, "--data.descents", str(descents), "--quiet"]
    words += ["--trainer.callbacks+=first_step.FirstStep"]
    code = f"from descentflow.cli.entry import main; main({words!r})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    said = [line.split() for line in done.stdout.splitlines() if line.startswith("loaded")]
    assert len(said) == 1, done.stderr
    loaded = set(said[0][1:])
    # scikit-learn takes pandas where it is installed.
    assert loaded - ({"pandas"} if "sklearn" in needed else set()) == needed
