"""The package on Windows: no module that only Unix has, tried by blocking these modules."""

import os
import subprocess
import sys
from pathlib import Path

UNIX_ONLY = ("fcntl", "grp", "pwd", "resource", "termios")
FRONT_DOOR = """
import os, sys, warnings
for name in {blocked}:
    sys.modules[name] = None
for name in ("fork", "geteuid", "killpg", "setsid", "sched_getaffinity", "sysconf",
             "O_CLOEXEC", "O_DIRECTORY", "O_NOFOLLOW"):
    delattr(os, name)
warnings.filterwarnings("ignore", "only soft file lock", UserWarning)  # Windows has locks of its own

import descentflow as df
import descentflow.effects
from descentflow.cli import main

def run(*words):
    assert main(list(words)) == 0, words

run("simulate", "--flights", "60", "--seed", "0", "--out", "rows.parquet")
run("prepare", "rows.parquet", "--out", "descents.parquet")
short = ["--trainer.max_epochs=1", "--scores.n_samples=200", "--final=false"]
run("fit", "--model", "Gaussian", "--data.descents", "descents.parquet", *short)
best = "runs/Gaussian/version_0/checkpoints/best.ckpt"
run("sample", best, "-n", "20", "--out", "samples.parquet")
model = df.load(best)
df.diagnose("rows.parquet", "A320", catalogue={{"mass": df.effects.EFFECTS["mass"]}}, out="gap")
df.evaluate(model, "descents.parquet", n=200, n_splits=2)
next(iter(df.Generator(model).next().trajectories.time_s))
print(len(df.sample(model, n=20, seed=0)))
"""


def test_the_front_door_needs_no_module_that_only_unix_has(tmp_path: Path) -> None:
    code = FRONT_DOOR.format(blocked=UNIX_ONLY)
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "20"
    assert not [name for name in os.listdir(tmp_path) if name.startswith(".")]
