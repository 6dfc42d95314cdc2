"""One page of a run: from its files, whole by itself, and honest where something is missing."""

import re
from pathlib import Path
from shutil import copytree

import polars as pl
import pytest
from html_toys import Elements

from descentflow.cli.entry import main
from descentflow.training.run_page.found_run import find_run
from descentflow.training.run_page.run_history import run_history

pytestmark = pytest.mark.usefixtures("components_once")

SECTIONS = (
    *("The model", "Profiles against held-out flights", "Scores beside noise floors", "Loss by epoch"),
    *("Scores by epoch", "Rejections", "Components", "Settings"),
)


@pytest.fixture(scope="module")
def page(run: Path) -> str:
    assert main(["open", str(run), "-n", "200", "--quiet"]) == 0
    return (run / "run.html").read_text(encoding="utf-8")


def test_the_page_holds_every_section_and_needs_nothing_but_itself(page: str) -> None:
    assert re.findall(r"<h2>([^<]+)</h2>", page) == list(SECTIONS)
    parser = Elements()
    parser.feed(page)
    assert parser.open == []
    assert not any(tag in ("script", "link", "iframe", "object") for tag, _ in parser.seen)
    # Nothing is asked for elsewhere: names of SVG's own languages are no addresses that are opened.
    assert not re.search(r"""(src|href|url)\s*[=(]\s*["']?(?!data:image/png|#)[a-z]+:""", page)
    for tag, attributes in parser.seen:
        assert tag != "img" or len(attributes["alt"] or "") > 20
        if "drawing" in (attributes.get("class") or ""):
            assert "nats per flight" in attributes["aria-label"] or "noise floor" in attributes["aria-label"]


def test_it_tells_the_scores_of_the_file_and_which_are_above_the_floor(page: str, run: Path) -> None:
    scores = pl.read_csv(run / "test" / "scores.csv", infer_schema_length=None)
    judged = scores.drop_nulls(["equal_size", "floor_high"])
    above = judged.filter(pl.col("equal_size") > pl.col("floor_high"))
    assert page.count("above the floor<") == len(above)
    assert page.count("as flights are<") == len(judged) - len(above)
    one = scores.row(0, named=True)
    assert f">{one['score']:.3g}<" in page


def test_scores_are_not_taken_twice_and_the_path_is_all_that_is_printed(page: str, run: Path, capsys) -> None:
    before = (run / "test" / "scores.csv").stat().st_mtime_ns
    assert main(["open", str(run / "checkpoints" / "best.ckpt")]) == 0
    assert capsys.readouterr().out == f"{run / 'run.html'}\n"
    assert (run / "test" / "scores.csv").stat().st_mtime_ns == before
    assert (run / "run.html").read_text(encoding="utf-8") == page


def test_what_is_missing_is_said_with_the_command_that_mends_it(run: Path, tmp_path: Path) -> None:
    bare = tmp_path / "<b>&run"
    copytree(run, bare, ignore=lambda *_: {"test", "run.html"})
    for events in bare.glob("events*"):
        events.unlink()
    settings = (bare / "config.yaml").read_text().splitlines()
    changed = ["  descents: gone/<i>.parquet" if line.startswith("  descents:") else line for line in settings]
    (bare / "config.yaml").write_text("\n".join(changed))
    assert main(["open", str(bare)]) == 0
    page = (bare / "run.html").read_text(encoding="utf-8")
    assert "The descents that it was trained on are not at gone/&lt;i&gt;.parquet." in page
    assert "<i>" not in page
    assert "<b>&run" not in page
    assert "descentflow test --ckpt_path" in page
    assert "Nothing was logged while it trained" in page
    assert not (bare / "test").exists()


def test_epochs_of_the_history_begin_at_one(run: Path) -> None:
    history = run_history(run)
    epochs, values = history.series["val/nll"]
    assert epochs.tolist() == list(range(1, len(values) + 1))
    assert history.best("val/nll")[1] == values.min()
    assert history.scored()


def test_what_is_no_run_is_refused(tmp_path: Path, capsys) -> None:
    assert main(["open", str(tmp_path)]) == 2
    assert "config.yaml and checkpoints/best.ckpt" in capsys.readouterr().err
    assert main(["open", str(tmp_path / "none")]) == 2
    assert "no file or folder" in capsys.readouterr().err


def test_newer_checkpoints_are_scored_again(run: Path, page: str) -> None:
    import os

    found = find_run(run)
    scores = found.scored / "scores.csv"
    assert found.is_scored
    kept = scores.stat()
    os.utime(scores, ns=(kept.st_atime_ns, found.checkpoint.stat().st_mtime_ns - 1))
    assert not found.is_scored
    os.utime(scores, ns=(kept.st_atime_ns, kept.st_mtime_ns))
