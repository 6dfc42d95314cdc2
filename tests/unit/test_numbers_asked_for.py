"""Numbers and seeds are whole numbers, or a message, in every function that takes them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import toys

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.densities import GaussianDensity
from descentflow.densities.density import Density

DRAWS: dict[str, Callable[[Density, Path, object], object]] = {
    "sample": lambda model, folder, n: df.sample(model, n),
    "evaluate": lambda model, folder, n: df.evaluate(model, folder / "absent.parquet", n=n),
    "export": lambda model, folder, n: df.export(model, "json", folder / "s.json", n=n),
    "Generator": lambda model, folder, n: df.Generator(model).next_batch(n),
    "simulate": lambda model, folder, n: df.simulate("A320", n),
}


@pytest.fixture(scope="module")
def model() -> Density:
    return gaussian()


def gaussian() -> Density:
    parts = toys.representation(120)
    density = GaussianDensity(parts.decoder.dimension)
    density.attach(parts)
    return density


@pytest.mark.parametrize("function", DRAWS)
@pytest.mark.parametrize("n", [0, -3, 1.5, "10", None])
def test_what_is_no_number_of_things_is_refused(function: str, n: object, model: Density, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="expected a whole number, 1 or more"):
        DRAWS[function](model, tmp_path, n)


def test_a_number_in_the_models_place_is_told_in_a_line(model: Density) -> None:
    with pytest.raises(ConfigError, match=r"^[^\n]*whole number[^\n]*$"):
        df.sample(model, model)


@pytest.mark.parametrize("budget", [0, -1, 2.5])
def test_a_budget_of_no_draw_is_refused(budget: object, model: Density) -> None:
    with pytest.raises(ConfigError, match=f"draw_budget = {budget}; expected a whole number, 1 or more"):
        df.sample(model, 5, draw_budget=budget)


def test_plausible_draws_beyond_the_number_asked_for_are_told() -> None:
    """Draws double each round for the samples that are still wanted, and several of a round may be plausible."""
    model = gaussian()
    narrow = model.representation.plausibility
    narrow.drag_high.copy_(narrow.drag_low + 0.6 * (narrow.drag_high - narrow.drag_low))
    report = df.sample(model, 50).report
    assert report.accepted + report.rejected + report.surplus == report.drawn
    assert report.surplus > 0
    assert f"plausible, {report.surplus} of them more than asked for; broken:" in str(report)


@pytest.mark.parametrize("seed", [0.5, "1", None, 1 << 64])
def test_what_is_no_seed_is_refused(seed: object, model: Density) -> None:
    for call in (df.sample, lambda path, _, seed: df.Generator(path, seed=seed)):
        with pytest.raises(ConfigError, match=r"seed = .*expected a whole number of 64 bits"):
            call(model, 3, seed=seed)


def test_numbers_of_numpy_count(model: Density) -> None:
    samples = df.sample(model, np.int32(7), seed=np.int64(-7))
    assert samples.to_polars().equals(df.sample(model, 7, seed=-7).to_polars())


@pytest.mark.parametrize("entry", ["FL350", "350", [None], {"fl": 350}])
def test_entry_levels_are_numbers(entry: object, model: Density) -> None:
    with pytest.raises(ConfigError, match=r"entry_fl = .* expected a finite number or several, each a finite number"):
        df.sample(model, 3, entry_fl=entry)


def test_a_generator_takes_one_level_of_entry(model: Density) -> None:
    with pytest.raises(ConfigError, match=r"entry_fl = .*expected a finite number or None"):
        df.Generator(model).next(entry_fl=[300, 310])


def test_more_than_the_memory_holds_is_refused_at_once(model: Density) -> None:
    with pytest.raises(ConfigError, match=r"1,000,000,000,000 descents of .* levels, [\d,]+ GB; expected at most"):
        df.sample(model, 10**12)


@pytest.mark.parametrize("entry", [150, 150.2])
def test_the_lowest_level_is_none_of_entry(entry: float, model: Density) -> None:
    with pytest.raises(ConfigError, match="flight levels above 150, up to"):
        df.sample(model, 3, entry_fl=entry)
    assert len(df.sample(model, 3, entry_fl=170)) == 3


def test_an_air_that_is_none(model: Density) -> None:
    with pytest.raises(ConfigError, match="air = 10; expected a path or"):
        df.sample(model, 3, air=10)
