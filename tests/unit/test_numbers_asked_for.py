"""Numbers and seeds are whole numbers, or a message, in every function that takes them."""

import pytest
import toys

import descentflow as df
from descentflow.core.errors import ConfigError
from descentflow.densities import GaussianDensity
from descentflow.densities.density import Density


@pytest.fixture(scope="module")
def model() -> Density:
    return gaussian()


def gaussian() -> Density:
    parts = toys.representation(120)
    density = GaussianDensity(parts.decoder.dimension)
    density.attach(parts)
    return density


def test_plausible_draws_beyond_the_number_asked_for_are_told() -> None:
    """Draws double each round for the samples that are still wanted, and several of a round may be plausible."""
    model = gaussian()
    narrow = model.representation.plausibility
    narrow.drag_high.copy_(narrow.drag_low + 0.6 * (narrow.drag_high - narrow.drag_low))
    report = df.sample(model, 500).report
    assert report.accepted + report.rejected + report.surplus == report.drawn
    assert report.surplus > 0
    assert f"plausible, {report.surplus} of them more than asked for; broken:" in str(report)


def test_more_than_the_memory_holds_is_refused_at_once(model: Density) -> None:
    with pytest.raises(ConfigError, match=r"1,000,000,000,000 descents of .* levels, [\d,]+ GB; expected at most"):
        df.sample(model, 10**12)


@pytest.mark.parametrize("entry", [150, 150.2])
def test_the_lowest_level_is_none_of_entry(entry: float, model: Density) -> None:
    with pytest.raises(ConfigError, match="flight levels above 150, up to"):
        df.sample(model, 3, entry_fl=entry)
    assert len(df.sample(model, 3, entry_fl=170)) == 3
