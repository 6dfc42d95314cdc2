"""Documents agree with the tree: links, the map, the new names of modules, and their length."""

import json
import re
import shlex
from contextlib import suppress
from pathlib import Path
from runpy import run_path

import pytest

from descentflow.cli import trainer_commands
from descentflow.cli.entry import main
from descentflow.core.version import __version__

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("*/*.md"))]
MOVED = re.compile(r"^\| (.*?) \| (.*?) \|$", re.MULTILINE)


def is_module(name: str) -> bool:
    place = ROOT.joinpath(*name.split("."))
    return place.with_suffix(".py").is_file() or (place / "__init__.py").is_file()


def modules_named(cell: str) -> list[str]:
    """Modules of a cell of the changelog: `a.b.c`, `.d` are a.b.c and a.b.d."""
    modules: list[str] = []
    for name in re.findall(r"`([\w.]+)`", cell):
        modules.append(name if not name.startswith(".") else modules[-1].rsplit(".", 1)[0] + name)
    return modules


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_relative_links_lead_somewhere(path: Path) -> None:
    links = re.findall(r"\]\(([^)#\s]+)", path.read_text(encoding="utf-8"))
    broken = [link for link in links if "://" not in link and not (path.parent / link).exists()]
    assert broken == []


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_tables_end_before_the_text_below_them(path: Path) -> None:
    """Without an empty line between, a sentence is shown as another row."""
    text = re.sub(r"```.*?```|\$\$.*?\$\$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert re.findall(r"^\|.*\|\n(?!\|)(.+)", text, re.MULTILINE) == []


def test_the_readme_is_short() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= 620


def test_the_paper_cites_what_is_in_its_bibliography_in_a_thousand_words() -> None:
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8").split("---\n", 2)[2]
    entries = re.findall(r"^@\w+\{(\w+),", (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted({*re.findall(r"@(\w+)", text)}) == sorted(entries)
    assert len(text.split()) <= 1000


def test_descriptions_for_catalogues_have_the_version_of_the_package() -> None:
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    described = json.loads((ROOT / "codemeta.json").read_text(encoding="utf-8"))["version"]
    assert cited is not None
    assert cited[1] == described == __version__


def test_nobody_is_sent_to_an_index_that_has_no_descentflow() -> None:
    texts = [*DOCUMENTS, *(path for folder in ("descentflow", "scripts") for path in (ROOT / folder).rglob("*.py"))]
    asked = re.compile(r"pip install ['\"]?descentflow")
    assert [path.name for path in texts if asked.search(path.read_text(encoding="utf-8"))] == []


def test_the_map_of_the_house_names_every_package_once() -> None:
    named = re.findall(r"^\| `(\w+)/` \|", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(named) == sorted(path.parent.name for path in (ROOT / "descentflow").glob("*/__init__.py"))


def test_files_that_contributors_are_sent_to_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    paths = [path for path in re.findall(r"`((?:descentflow|tests|docs|scripts)/[\w./-]+)`", text) if "my_" not in path]
    assert len(paths) > 8
    assert [path for path in paths if "XXXX" not in path and not (ROOT / path).exists()] == []


def test_the_changelog_maps_old_modules_to_modules_that_there_are() -> None:
    rows = [row for row in MOVED.findall((ROOT / "CHANGELOG.md").read_text(encoding="utf-8")) if "`" in row[0]]
    assert len(rows) > 20
    assert [name for _, now in rows for name in modules_named(now) if not is_module(name)] == []


def commands_of(path: Path) -> list[list[str]]:
    """The words of every `descentflow` command that a page shows."""
    blocks = re.findall(r"```sh\n(.*?)```", path.read_text(encoding="utf-8"), re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("descentflow ")]


@pytest.mark.parametrize("path", [*filter(commands_of, DOCUMENTS)], ids=lambda path: path.stem)
def test_commands_of_the_pages_have_the_options_that_there_are(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unknown = []
    for name, *words in commands_of(path):
        if name in trainer_commands.COMMANDS:
            given = words if name == "fit" else ["--model", "Gaussian", "--data.descents", "d", *words]
            where = given.index("--ckpt_path") if "--ckpt_path" in given else len(given)
            given = [word for word in [*given[:where], *given[where + 2 :]] if "my_module" not in word]
            given = ["Gaussian" if word == "my_density.py" else word for word in given]
            with pytest.raises(SystemExit) as ended:  # as soon as it has printed
                main(["fit", *given, "--print_config"])
            assert ended.value.code == 0
            continue
        with suppress(SystemExit):
            main([name, "--help"])
        known = re.findall(r"--[\w-]+", capsys.readouterr().out)
        unknown += [f"{name} {word}" for word in words if word.startswith("--") and word not in known]
    assert unknown == []


def test_every_package_has_its_place_on_the_map_of_the_house() -> None:
    placed = run_path(str(ROOT / "docs/_ext/packages.py"))["layers"]()
    assert "watching" in [path.name for path in placed["Diagnosis"]]
