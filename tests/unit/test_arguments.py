"""Arguments of public calls are checked by their annotations: what is of another kind is refused by its name."""

from collections.abc import Callable, Mapping, Sequence
from inspect import Parameter, signature
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import polars as pl
import pytest
import torch
import xarray
from jsonargparse.typing import OpenUnitInterval

import descentflow as df
from descentflow.core.arguments import Count, Within, checked_arguments, kind_of
from descentflow.core.errors import ConfigError
from descentflow.core.tabular import to_pandas
from descentflow.positions.ground_plan import ground_plan
from descentflow.positions.wind import Wind, wind_of_text

NAN = float("nan")


@pytest.mark.parametrize(
    ("hint", "taken", "refused"),
    [
        (int, [0, -5, 2**63 - 1], [1.0, True, "1", None, 2**63, NAN]),
        (Count, [1], [0, -1, 2.5]),
        (float | None, [1, 2.5, None, 1e300], [NAN, float("inf"), True, "1", 1j, 2**64]),
        (Annotated[float, Within(0, 1)], [0, 0.5, 1], [-0.1, 1.1]),
        (OpenUnitInterval, [0.5], [0, 1, "0.5", NAN]),
        (bool, [True], [1, 0, None, pl.DataFrame()]),
        (str, ["a", ""], [b"a", Path(), "a\0b", "\ud800", None]),
        (str | Path, ["a", Path("b")], ["", b"a", "a\0b", "x" * 256, Path("x" * 256), 5, None]),
        (Literal["aic", "bic"], ["aic"], ["AIC", None, ["aic"], np.zeros(2)]),
        (Sequence[str], [["a"], ("a",), pl.Series(["a"]), np.array(["a"]), []], ["a", {"a"}, {"a": 1}, [None], 5]),
        (Sequence[float], [[1, 2.5], np.zeros(3), torch.ones(2)], [[NAN], [True], np.zeros((2, 2)), pl.DataFrame()]),
        (list[str], [["a"], ("a",)], ["a", pl.DataFrame({"a": [1]}), [1]]),
        (tuple[float, float | None], [(1, None), [1, 2]], [(1,), (None, 1), "12"]),
        (Mapping[str, float], [{}, {"a": 1}], [{1: 1}, {"a": NAN}, [("a", 1)]]),
        (Callable[[int], None], [print, lambda n: None, int], [None, 5, lambda: None]),
        (pl.DataFrame | None, [pl.DataFrame(), None], [{}, "a", pl.Series()]),
        (Any, [None, 5, object(), "a"], ["", "x" * 256, Path("a\0b")]),
        (Wind | None, [wind_of_text("270/35"), None], [to_pandas(pl.DataFrame({"level_fl": [100]})), pl.DataFrame()]),
    ],
)
def test_an_annotation_takes_what_it_says(hint: Any, taken: list[Any], refused: list[Any]) -> None:
    kind = kind_of(hint)
    assert [value for value in taken if not kind.takes(value)] == []
    assert [value for value in refused if kind.takes(value)] == []


def test_numbers_of_other_libraries_become_pythons_own() -> None:
    @checked_arguments
    def kinds(n: int, share: float = 0.5) -> tuple[type, type]:
        return type(n), type(share)

    for number in (np.int32(3), np.array(3), torch.tensor(3)):
        assert kinds(number, share=np.float32(0.5)) == (int, float)
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'n'"):
        kinds()
    with pytest.raises(TypeError, match="unexpected keyword argument 'm'"):
        kinds(3, m=5)


def test_tables_of_other_libraries_become_those_of_polars() -> None:
    @checked_arguments
    def shape(air: str | Path | Mapping[str, Any] | pl.DataFrame) -> list[str]:
        assert isinstance(air, pl.DataFrame)
        return air.columns

    table = pl.DataFrame({"level_fl": [100, 350], "deviation_k": [10.0, 20.0]})
    by_level = to_pandas(table).set_index("level_fl")
    for given in (table, table.lazy(), to_pandas(table), by_level, xarray.Dataset.from_dataframe(by_level)):
        assert shape(given) == table.columns


RIGHT = {
    "typecode": "A320",
    "aircraft": "A320",
    "n_flights": 1,
    "descents": "descents.parquet",
    "path": "x",
    "to": "json",
    "from_fl": 290.0,
    "days": "days",
    "state": "watched",
}
"""Arguments of calls beside the wrong one; those that may be anything are None."""
CALLS: dict[str, Any] = {
    name: getattr(df, name) for name in df.__all__ if name not in ("DescentflowError", "__version__")
}
CALLS |= {"Generator.next_batch": df.Generator.next_batch, "ground_plan": ground_plan}


@pytest.mark.parametrize("name", CALLS)
def test_every_argument_of_a_public_call_is_refused_by_its_name(name: str) -> None:
    parameters = signature(CALLS[name]).parameters.values()
    needed = {one.name: RIGHT.get(one.name) for one in parameters if one.default is Parameter.empty}
    needed = {key: value for key, value in needed.items() if key != "data_options"}
    for one in parameters:
        if one.name in ("self", "data_options") or kind_of(one.annotation).takes(wrong := object()):
            continue
        with pytest.raises(
            ConfigError, match=rf"^{one.name} = <object .*; expected .*; to mend it, see help\("
        ) as caught:
            CALLS[name](**{**needed, **({"n": 1} if "n" in needed else {}), one.name: wrong})
        assert "typing." not in str(caught.value)


def test_the_current_folder_is_no_output() -> None:
    with pytest.raises(ConfigError, match=r"output \.; expected the name of a file or a folder"):
        df.prepare(pl.DataFrame(), out=Path())
