"""The density that is taken where none is named: the likeliest of flights of held-out aircraft."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import polars as pl
import pytest
import torch
import toys
from torch import Tensor

from descentflow.densities.density import Density
from descentflow.training.datamodule import DescentDataModule
from descentflow.training.fit import SPLITS, fit, most_probable


def test_the_likeliest_is_named_with_its_lead() -> None:
    """Three splits of ten flights; the lead and its standard error are those of the thirty differences."""
    rng = np.random.default_rng(0)
    by_name = {
        name: rng.normal(mean, 1.0, (SPLITS, 10)) for name, mean in (("gaussian", 0), ("mixture", 5), ("flow", 4))
    }

    def resplit(seed: int) -> Any:
        return SimpleNamespace(seed=seed, evidence=lambda part: part, contexts=lambda part: part)

    def fitted(name: str, split: Any) -> Density:
        def log_observed(evidence: str, context: str) -> Tensor:
            assert (evidence, context) == ("test", "test")
            return torch.from_numpy(by_name[name][split.seed])

        return cast(Density, SimpleNamespace(log_observed=log_observed))

    name, why = most_probable(cast(DescentDataModule, SimpleNamespace(resplit=resplit)), fitted)
    lead = (by_name["mixture"] - by_name["flow"]).ravel()
    assert name == "mixture"
    assert f"mixture, by {lead.mean():.2f} +- {lead.std(ddof=1) / 30**0.5:.2f} nats a flight over flow" in why


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return toys.write_descents_file(tmp_path_factory.mktemp("data") / "a320.parquet", 120)


def test_training_flights_are_split_again_by_aircraft_in_the_same_components(descents: Path) -> None:
    data = DescentDataModule(descents)
    data.setup()
    owner = dict(pl.read_parquet(descents).select("flight_id", "icao24").unique().iter_rows())
    first, second = data.resplit(0), data.resplit(1)
    parts = [set(first.profiles(part).flight_ids) for part in ("train", "validation", "test")]
    assert set.union(*parts) == set(data.profiles("train").flight_ids)
    owners = [{owner[f] for f in part} for part in parts]
    assert owners[2].isdisjoint(owners[0] | owners[1])
    assert abs(len(parts[2]) / sum(map(len, parts)) - 1 / 3) < 0.15
    assert parts[2] != set(second.profiles("test").flight_ids)
    assert first.representation is data.representation
    assert len(first.evidence("test")) == len(parts[2])


def test_a_fit_without_a_name_reports_its_choice(descents: Path) -> None:
    model = fit(descents, max_epochs=2, final=False, explained_variance=0.7)
    assert "chosen of gaussian, mixture, flow: " in repr(model)
    assert type(model).__name__.lower().endswith(model.chosen.split(": ")[1].split(",")[0])
    assert "chosen of" not in repr(fit(descents, "gaussian", final=False, explained_variance=0.7))
