"""Names that strangers wrote are text in every page and table, and name no file."""

import csv
import os
import pickle
import re
import subprocess
from pathlib import Path
from shutil import which

import polars as pl
import pytest
import torch
from surveillance_toys import fleet

import descentflow as df
from descentflow.cli.entry import main
from descentflow.core.tabular import safe_in_spreadsheets, write_table
from descentflow.surveillance.descents.prepared_descents import Descents, write_descents

SCRIPT = (
    '"><script>document.title="RAN"</script><img src="http://192.0.2.1/a.png" onerror=document.title="RAN">'
    "<svg/onload=document.title='RAN'></svg>]]><style>*{background:url(http://192.0.2.1/b)}</style>"
)
BROWSER = which("chromium") or which("chromium-browser") or which("google-chrome")


def shown_in_browser(page: Path, folder: Path) -> tuple[str, str]:
    """The page's elements after its scripts have run, and the log of the network."""
    log = folder / "net.json"
    words = [BROWSER, "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    words += [f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}", "--virtual-time-budget=3000"]
    done = subprocess.run(
        [*words, "--dump-dom", page.as_uri()], capture_output=True, text=True, check=True, timeout=120
    )
    return done.stdout, log.read_text()


def title_of(dom: str) -> str:
    found = re.search(r"<title>(.*?)</title>", dom, re.DOTALL)
    assert found
    return found[1]


def hostile_rows(number: int) -> pl.DataFrame:
    """Rows whose flights, callsigns and types are script."""
    name = pl.format("{}{}", pl.lit(SCRIPT), "icao24")
    return fleet(number).with_columns(flight_id=name, callsign=pl.lit(SCRIPT), typecode=pl.lit(SCRIPT))


@pytest.mark.skipif(BROWSER is None, reason="there is no browser here")
def test_no_script_runs_and_no_request_leaves(tmp_path: Path) -> None:
    """A browser opens the page of the cleaning; one that lets script through fails."""
    hostile_rows(3).write_parquet(tmp_path / "rows.parquet")
    out = ["--out", str(tmp_path / "descents.parquet"), "--figures", str(tmp_path / "look")]
    assert main(["prepare", str(tmp_path / "rows.parquet"), *out]) == 0
    page = tmp_path / "look" / "index.html"
    assert "&lt;script&gt;" in page.read_text(encoding="utf-8"), "the names are in the page"
    dom, requests = shown_in_browser(page, tmp_path)
    assert "RAN" not in title_of(dom)
    assert "192.0.2.1" not in requests
    open_page = tmp_path / "open.html"
    open_page.write_text(f"<title>before</title><p>{SCRIPT}</p>")
    dom, requests = shown_in_browser(open_page, tmp_path)
    assert title_of(dom) == "RAN", "what the test would overlook"
    assert "192.0.2.1" in requests, "what the test would overlook"


@pytest.mark.skipif(BROWSER is None, reason="there is no browser here")
@pytest.mark.slow
def test_pages_of_hostile_flights_files_and_simulators_are_text(tmp_path: Path) -> None:
    def side(seed: int) -> Descents:
        rows = df.simulate("A320", 90, seed=seed).rows
        name = pl.format("{}{}", pl.lit(SCRIPT), "flight_id")
        return df.prepare(rows.with_columns(flight_id=name, callsign=pl.lit(SCRIPT)))

    real, flown = side(1), side(2)
    df.diagnose(real, flown, simulator_name=SCRIPT, out=tmp_path / "gap")
    df.qualify(real, flown, simulator_name=SCRIPT, out=tmp_path / "qualified")
    (tmp_path / "days").mkdir()
    write_descents(real, tmp_path / "days" / "<svg onload=document.title='RAN'>.parquet")
    (tmp_path / "days" / "<img src=x onerror=document.title='RAN'>.csv").write_text(SCRIPT)
    df.watch("A320", tmp_path / "days", state=tmp_path / "watched")
    for name in ("gap/gap.html", "qualified/qualification.html", "watched/watch.html"):
        assert "&lt;" in (tmp_path / name).read_text(encoding="utf-8"), "the names are in the page"
        dom, requests = shown_in_browser(tmp_path / name, tmp_path)
        assert title_of(dom) != "RAN"
        assert "192.0.2.1" not in requests


def test_cells_that_a_spreadsheet_would_execute_are_text(tmp_path: Path) -> None:
    odd = ["=1+1", "+1+1", "-1+1", "@SUM(A1)", "\t=1", "\r=1", '=HYPERLINK("http://192.0.2.1")']
    plain = ["AB12", "-4", "+4.5", "-1e3", "", None, "a=b"]
    table = pl.DataFrame({"flight_id": [*odd, *plain], "=cmd": range(len(odd) + len(plain))})
    write_table(table, tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as file:
        head, *found = csv.reader(file)
    assert head == ["flight_id", "'=cmd"]
    assert [row[0] for row in found] == [f"'{text}" for text in odd] + [text or "" for text in plain]
    write_table(table, tmp_path / "table.parquet")
    assert pl.read_parquet(tmp_path / "table.parquet").equals(table)
    numbers = pl.DataFrame({"rate": [-1500.0]})
    assert safe_in_spreadsheets(numbers).equals(numbers)


class Touch:
    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.system, (f"touch {self.target}",)


@pytest.mark.parametrize("command", ["prepare --out o.parquet --config", "fit --config", "info", "sample --out o.csv"])
def test_nothing_that_a_file_holds_is_executed(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    target = tmp_path / "executed"
    Path("settings.yaml").write_text(f"!!python/object/apply:os.system ['touch {target}']")
    torch.save({"descentflow": Touch(target)}, "model.ckpt")
    name, *more = command.split()
    file = "settings.yaml" if "--config" in more else "model.ckpt"
    rows = ["rows.csv"] if name == "prepare" else []
    assert main([name, *rows, *more, file]) == 2
    assert file in capsys.readouterr().err
    assert not target.exists()
    pickle.loads(pickle.dumps(Touch(target)))
    assert target.exists(), "what the test would overlook"
