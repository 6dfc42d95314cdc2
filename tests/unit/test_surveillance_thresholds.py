"""Thresholds are said once: the options, the YAML file and the library agree; wrong ones are refused."""

import argparse
from dataclasses import fields, replace
from pathlib import Path

import pytest

from descentflow.cli.options import CommandParser
from descentflow.cli.prepare_command import cleaning_of_options, extend, memory_bytes, run
from descentflow.core.errors import ConfigError
from descentflow.core.user_files import read_settings
from descentflow.surveillance.cleaning.thresholds import Cleaning, cleaning_of, meaning_of

DEFAULT = Path(__file__).resolve().parents[2] / "descentflow" / "configs" / "prepare" / "default.yaml"


def test_the_yaml_file_holds_every_threshold_with_its_meaning_and_source() -> None:
    first, *paragraphs = DEFAULT.read_text().split("\n\n")
    assert first.startswith("# Thresholds of `descentflow prepare --config`")
    for field, paragraph in zip(fields(Cleaning), paragraphs, strict=True):
        *comment, line = paragraph.splitlines()
        meaning, source = " ".join(text.removeprefix("# ") for text in comment).split(". Source: ")
        assert meaning[0].lower() + meaning[1:] in (found := meaning_of(field.name), found[0].lower() + found[1:])
        assert len(source) > 10
        value = getattr(Cleaning(), field.name)
        assert line == f"{field.name}: {'null' if value is None else value}"
    assert cleaning_of(read_settings(DEFAULT), "file") == Cleaning()


def test_options_go_before_the_file_and_the_file_before_defaults(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("slowest_fpm: 400\ntransient_s: 10\n")
    parser = CommandParser("prepare", run)
    extend(parser)

    def cleaning(*words: str) -> Cleaning:
        given = vars(parser.parse_args(["x", "--out", "y", *words]))
        return cleaning_of_options(
            given["config"], {f.name: given[f.name] for f in fields(Cleaning) if f.name in given}
        )

    mixed = cleaning("--config", str(file), "--transient-s", "15", "--bottom-fl", "100")
    assert mixed == Cleaning(slowest_fpm=400.0, transient_s=15.0, bottom_fl=100)
    options = [f"--{f.name.replace('_', '-')}" for f in fields(Cleaning)]
    every = [word for name in options for word in ((name,) if name == "--idle-only" else (name, "7"))]
    assert cleaning(*every) == replace(Cleaning(*[7] * len(fields(Cleaning))), idle_only=5.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("slowest: 400", "no threshold slowest"),
        ("slowest_fpm: fast", "slowest_fpm is 'fast'"),
        ("slowest_fpm: -1", "slowest_fpm is -1"),
        ("slowest_fpm: .nan", "slowest_fpm is nan"),
        ("bottom_fl: 99.5", "a whole number"),
        ("- 400", "holds a list"),
        ("a: [", "expected a YAML file"),
        ("\x00", "expected a YAML file"),
    ],
)
def test_wrong_thresholds_are_refused(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError, match=words):
        cleaning_of(read_settings(file), str(file))


def test_sizes_are_read_as_people_write_them() -> None:
    assert [memory_bytes(text) for text in ("2GB", "800 MB", "1.5g", "123", "1GiB")] == [
        2_000_000_000,
        800_000_000,
        1_500_000_000,
        123,
        2**30,
    ]
    for text in ("", "GB", "-2GB", "2 apples"):
        with pytest.raises(argparse.ArgumentTypeError, match="expected a size"):
            memory_bytes(text)


def test_thresholds_given_in_python_are_checked_as_those_of_a_file(tmp_path: Path) -> None:
    """A bottom of 280.0 was written into descents as it was, and then taken for no level: their cleaning was lost."""
    assert repr(Cleaning(bottom_fl=280.0).bottom_fl) == "280"
    assert repr(Cleaning(stale_s=20).stale_s) == "20.0"
    for wrong in ({"bottom_fl": 99.5}, {"slowest_fpm": "fast"}, {"bottom_fl": None}):
        with pytest.raises(ConfigError, match="Cleaning: "):
            Cleaning(**wrong)
