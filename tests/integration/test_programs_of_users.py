"""Programs of users around ours, each as a user runs it; slow, and skipped where the program is not installed."""

import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from pathlib import Path

import pytest
from command_line_toys import QUICK
from polars.testing import assert_frame_equal
from surveillance_toys import fleet, written

import descentflow as df
from descentflow.cli.entry import main

pytestmark = pytest.mark.slow
APP = """
import asyncio
from pathlib import Path

import descentflow as df
from descentflow.effects import EFFECTS


def diagnosis():
    Path("begun").touch()
    return str(df.diagnose("{descents}", "A320", catalogue={{"mass": EFFECTS["mass"]}}, out="gap"))


async def app(scope, receive, send):
    text = await asyncio.to_thread(diagnosis)
    await send({{"type": "http.response.start", "status": 200, "headers": []}})
    await send({{"type": "http.response.body", "body": text.encode()}})
"""


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


def wait_for(path: Path, server: subprocess.Popen[bytes]) -> None:
    for _ in range(6000):
        if path.exists():
            return
        assert server.poll() is None, "the server ended"
        time.sleep(0.05)
    raise AssertionError(f"{path} never came")


def test_a_server_that_is_stopped_while_it_diagnoses_answers_first(descents: Path, tmp_path: Path) -> None:
    pytest.importorskip("uvicorn", reason="pip install uvicorn")
    (tmp_path / "served.py").write_text(APP.format(descents=descents))
    port, answers = free_port(), list[str]()
    words = [sys.executable, "-m", "uvicorn", "served:app", "--port", str(port), "--lifespan", "off"]
    with (tmp_path / "log").open("wb") as log:
        server = subprocess.Popen(words, cwd=tmp_path, stderr=log, stdout=log)

    def ask() -> None:
        for _ in range(600):
            try:
                with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=600) as answer:
                    answers.append(answer.read().decode())
                return
            except ConnectionRefusedError:
                time.sleep(0.2)
            except urllib.error.URLError as error:
                if not isinstance(error.reason, ConnectionRefusedError):
                    raise
                time.sleep(0.2)

    asking = threading.Thread(target=ask)
    asking.start()
    wait_for(tmp_path / "begun", server)
    server.send_signal(signal.SIGTERM)
    asking.join(600)
    assert server.wait(60) in (0, -signal.SIGTERM)
    assert "A320" in answers[0]
    assert "</html>" in (tmp_path / "gap" / "gap.html").read_text()
    assert "Traceback" not in (tmp_path / "log").read_text()


def test_a_bucket_of_s3_is_read_and_written_as_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    server = pytest.importorskip("moto.server", reason="pip install 'moto[server]' '.[s3]'")
    s3fs = pytest.importorskip("s3fs", reason="pip install '.[s3]'")
    running = server.ThreadedMotoServer(port=free_port())
    running.start()
    try:
        monkeypatch.setenv("AWS_ENDPOINT_URL", "http://{}:{}".format(*running.get_host_and_port()))
        for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
            monkeypatch.setenv(name, "of-moto")
        monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        s3fs.S3FileSystem.clear_instance_cache()
        files = s3fs.S3FileSystem()
        files.mkdir("radar")
        files.put(str(written(fleet(12), tmp_path / "rows.parquet")), "radar/rows/rows.parquet")
        here = df.prepare(tmp_path / "rows.parquet")
        df.prepare("s3://radar/rows", out="s3://radar/descents.parquet")
        assert_frame_equal(df.read_descents("s3://radar/descents.parquet").frame, here.frame)
        assert files.find("radar") == ["radar/descents.parquet", "radar/rows/rows.parquet"]
    finally:
        running.stop()


@pytest.mark.parametrize(
    ("module", "logger", "options"),
    [
        ("mlflow", "MLFlowLogger", ["tracking_uri=sqlite:///store.db"]),
        ("wandb", "WandbLogger", ["offline=true", "save_dir=store"]),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_two_runs_into_one_store_of_a_logger_are_both_kept(
    module: str, logger: str, options: list[str], descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip(module, reason=f"pip install {module}")
    monkeypatch.chdir(tmp_path)
    words = ["fit", "--model", "Gaussian", "--data.descents", str(descents), *QUICK, f"--trainer.logger={logger}"]
    kept: list[dict[Path, bytes]] = []
    for _ in range(2):
        assert main([*words, *(f"--trainer.logger.{option}" for option in options)]) == 0
        if module == "wandb":
            pytest.importorskip("wandb").finish()  # as the end of a process does
        kept.append({path: path.read_bytes() for path in tmp_path.rglob("best.ckpt")})
    assert [len(run) for run in kept] == [1, 2]
    assert kept[0].items() <= kept[1].items(), "the first run is as it was"
    assert all(len(df.sample(path, 2)) == 2 for path in kept[1])


@pytest.mark.filterwarnings("ignore")
def test_the_sweep_of_the_page_ends_with_the_best_of_its_trials(
    descents: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("optuna", reason="pip install optuna")
    monkeypatch.chdir(tmp_path)
    shutil.copy(descents, "descents.parquet")
    page = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "lightning.md"
    names: dict[str, object] = {"__name__": "page"}
    for block in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        exec(block, names)
    study = pytest.importorskip("optuna").study
    made = names["study"]
    assert isinstance(made, study.Study)
    values = [trial.value for trial in made.trials if trial.state.name == "COMPLETE"]
    assert len(made.trials) == 3
    assert made.best_value == min(value for value in values if value is not None)
