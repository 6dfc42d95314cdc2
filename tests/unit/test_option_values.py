"""Wrong values of options of `fit` are said in plain words: what was got, what is taken, and how it is written."""

import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest
import toys

from descentflow.cli.option_kinds import is_wrong
from descentflow.cli.parser_errors import config_error
from descentflow.cli.trainer_inputs import check_descents_to_fit
from descentflow.cli.trainer_words import check_words
from descentflow.core.errors import AircraftError, ConfigError, DataError

UNION = """Parser key "{key}":
  Does not validate against any of the Union subtypes
  Subtypes: [{kinds}]
  Errors:
    - Expected a <class 'int'>
    - Expected a <class 'NoneType'>
  Given value type: <class 'str'>
  Given value: {value}"""
"""The parser's message on a value of none of several types."""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--data.context", "hour"], "--data.context is hour; expected a list of names, .*'.hour.'$"),
        (["--data.explained_variance=80"], "is 80; expected a number between 0 and 1; .* write 0.8 for 80 %"),
        (["--data.explained_variance", "none"], "is none; expected a number between 0 and 1"),
        (["--data.batch_size", "0"], "is 0; expected a whole number above 0"),
        (["--model.jitter", "-1"], "--model.jitter is -1; expected a number from 0 to 1"),
    ],
)
def test_surely_wrong_values_are_told_at_once(words: list[str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        check_words("fit", ["--model", "Gaussian", *words, "--print_config"])


@pytest.mark.parametrize(
    "words",
    [
        ["--data.context", "[hour]"],
        ["--data.context", "null"],
        ["--data.context+", "hour"],
        ["--data.context+=hour"],
        ["--data.explained_variance", "8e-1"],
        ["--data.mass_kg", "6e4"],
        ["--data.mass_kg", "null"],
        ["--data.bottom_fl", "1.5"],
    ],
)
def test_what_may_be_right_is_left_to_the_full_parser(words: list[str]) -> None:
    check_words("fit", ["--model", "Gaussian", *words, "--print_config"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'Parser key "data.explained_variance":\n  Not of type OpenUnitInterval: 80 does not conform to restriction '
            "v>0 and v<1",
            "--data.explained_variance is 80; expected a number between 0 and 1; to mend it, write 0.8 for 80 %.*",
        ),
        (
            UNION.format(key="data.context", kinds="list[str], <class 'NoneType'>", value="hour"),
            "--data.context is hour; expected a list of names, .a, b., or null for none; to mend it, write .*'.hour.'",
        ),
        (
            UNION.format(key="trainer.max_epochs", kinds="<class 'int'>, <class 'NoneType'>", value="x"),
            "--trainer.max_epochs is x; expected a whole number or null for none; .*",
        ),
        (
            UNION.format(key="data.mass_kg", kinds="<class 'jsonargparse.typing.PositiveFloat'>", value="heavy"),
            "--data.mass_kg is heavy; expected a number above 0; .*",
        ),
        (
            "Parser key \"data.speed\":\n  Expected a typing.Literal['auto', 'cas', 'mach_cas']. Got value: mach_cs",
            "--data.speed is mach_cs; expected auto, cas or mach_cas; to mend it, write --data.speed mach_cas",
        ),
        (
            "Parser key \"data.residual\":\n  Expected a <class 'bool'>. Got value: maybe",
            ".* expected true or false; .*",
        ),
        (
            UNION.format(key="trainer.logger", kinds="<class 'lightning.Logger'>, <class 'bool'>", value="foo"),
            "--trainer.logger is foo; expected the name of a class Logger or true or false; .*",
        ),
        (
            'Parser key "model":\n  Problem with given class_path \'descentflow.Gaussian\':\n    Parser key "jitter":\n'
            "  Not of type ClosedUnitInterval: 2 does not conform to restriction v>=0 and v<=1\n"
            "  Given value type: <class 'jsonargparse._util.NestedArg'>\n"
            "  Given value: NestedArg(key='jitter', val='2')",
            "--model.jitter is 2; expected a number from 0 to 1; .*",
        ),
        ("Parser key \"config\": File does not exist: '/a/nofile.yaml'", "no file /a/nofile.yaml; .*"),
        ("something else\n  is wrong", "something else; is wrong; expected options, .*"),
    ],
)
def test_what_the_full_parser_says_is_put_in_plain_words(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=f"^{message}$"):
        raise config_error(text)


def test_the_real_parser_speaks_as_it_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    from descentflow.cli.trainer import run

    for words, message in (
        (["--data.bottom_fl", "1.5"], "--data.bottom_fl is 1.5; expected a whole number or null for none; "),
        (["--model.jitter", "2"], "--model.jitter is 2; expected a number from 0 to 1; "),
        (["--data.fpca", "pca"], "--data.fpca is pca; expected ppca or iterative; "),
        (["--trainer.devices", "x"], "options of the trainer that it does not take: .*devices"),
    ):
        with pytest.raises(ConfigError, match=message):
            run("fit", ["--model", "Gaussian", "--data.descents", "d.parquet", *words])


def test_kinds_that_are_not_known_are_never_wrong() -> None:
    assert not is_wrong("anything", ["SplitBy"])
    assert not is_wrong("anything", [])
    assert not is_wrong(".inf", ["PositiveFloat"])


def test_descents_that_cannot_be_fitted_are_refused_at_once(tmp_path: Path) -> None:
    rows, own = tmp_path / "rows.parquet", tmp_path / "own.yaml"
    pl.DataFrame({"altitude": [1.0]}).write_parquet(rows)
    good = toys.write_descents_file(tmp_path / "descents.parquet", 5)
    glider = toys.write_descents_file(tmp_path / "gliders.parquet", 5, typecode="GLID")
    own.write_text(f"data: {{descents: {rows}}}")
    fit = ["--model", "Gaussian"]
    for words, kind, message in (
        (["--data.descents", str(tmp_path / "nofile.parquet")], DataError, "no file .*nofile.parquet"),
        (["--data.descents", str(rows)], DataError, "but not prepared descents"),
        (["--config", str(own)], DataError, "but not prepared descents"),
        (["--data.descents", str(glider)], AircraftError, "GLID"),
        (["--data.descents", str(good), "--data.aircraft", "GLID"], AircraftError, "GLID"),
    ):
        with pytest.raises(kind, match=message):
            check_descents_to_fit(check_words("fit", [*fit, *words]))
    for words in (
        ["--data.descents", str(good)],
        ["--config", str(own), "--data.descents", str(good)],
        ["--data.descents", str(glider), "--data.aircraft", "A320"],
        ["--data.descents", str(tmp_path)],
        ["--data.descents", f"[{good}, {good}]"],
    ):
        check_descents_to_fit(check_words("fit", [*fit, *words]))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["fit", "--model", "Gaussian", "--data.descents", "no"], "descentflow fit: no file no; expected prepared"),
        (["test", "--ckpt_path", "no.ckpt"], "descentflow test: no file no.ckpt; expected a checkpoint"),
        (["info", "no.ckpt"], "descentflow info: no file no.ckpt; expected a checkpoint"),
        (["sample", "no.ckpt", "-n", "3", "--out", "s.csv"], "descentflow sample: no file no.ckpt; expected a check"),
    ],
)
def test_torch_is_not_waited_for(words: list[str], told: str) -> None:
    asks = (
        f"import sys; from descentflow.cli.entry import main; main({words});"
        "print(sorted({'torch', 'lightning'} & set(sys.modules)))"
    )
    answer = subprocess.run([sys.executable, "-c", asks], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
    assert answer.stderr.startswith(told)
