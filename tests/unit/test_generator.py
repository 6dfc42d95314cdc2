"""A generator's streams, what it refuses, and descents that have begun."""

import pickle
import re
import subprocess
import sys
from ast import literal_eval
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import generator_toys as toy
import numpy as np
import polars as pl
import pytest
import torch
import toys
from generator_toys import cas_kt, index
from refusals import refuses
from scipy.stats import ks_2samp

import descentflow as df
from descentflow.core.errors import ConfigError, DataError, ImplausibleError
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.densities.checkpoint import content_of
from descentflow.densities.gaussian import GaussianDensity
from descentflow.generation.prediction.predictor import DescentPredictor
from descentflow.representation.context import ContextEncoder
from descentflow.representation.representation import Representation
from descentflow.representation.residuals import Residuals

ASKED: list[dict[str, object]] = [
    {},
    {"entry_fl": 350},
    {"entry_fl": 350, "cas_kt": {290: 290}},
    {"entry_fl": 350, "mach": (0.76, 0.78), "cas_kt": {290: (280, 300)}},
    {"entry_fl": 350, "time_s": (140, 160), "level": 300},
    {"mach": (None, 0.775)},
]


def generator(seed: int = 5, **settings: object) -> df.Generator:
    return df.Generator(toy.mixture(), seed=seed, **settings)


def same(first: object, other: object) -> bool:
    """Equal but for the last digits: products of matrices sum in another order in another batch."""
    names = ("time_s", "cas_mps", "mach", "tas_mps", "rate_mps", "drag_n")
    near = (torch.allclose(getattr(first, name), getattr(other, name), rtol=1e-9, atol=1e-9) for name in names)
    return torch.equal(first.entry, other.entry) and all(near)


@pytest.mark.parametrize("asked", ASKED)
def test_a_batch_is_what_single_calls_give(asked: dict[str, object]) -> None:
    own_generator = generator()
    together = generator().next_batch(23, **asked).trajectories
    for size in (1, 5, 17):
        first = int(own_generator._next)
        part = own_generator.next_batch(size, **asked).trajectories
        assert same(part, together.subset(torch.arange(first, first + size)))


def test_a_number_makes_the_descent_and_moves_nothing() -> None:
    own_generator = generator()
    seventh = own_generator.next(entry_fl=350, number=7)
    assert own_generator.next(entry_fl=350).first == 0
    assert same(seventh.trajectories, generator().next_batch(8, entry_fl=350).trajectories.subset(torch.tensor([7])))
    assert not same(seventh.trajectories, generator(seed=6).next(entry_fl=350, number=7).trajectories)
    assert same(seventh.trajectories, generator(first=7).next(entry_fl=350).trajectories)


def test_threads_share_a_generator() -> None:
    """Every number is drawn once, and every descent is that of a serial call."""
    shared, calls = generator(), 300
    with ThreadPoolExecutor(4) as pool:
        descents = list(pool.map(lambda k: shared.next(**ASKED[2 if k % 2 else 1]), range(calls)))
    assert sorted(each.first for each in descents) == list(range(calls))
    other = generator()
    for each in descents:
        serial = other.next(**ASKED[2 if len(each.asked) > 1 else 1], number=each.first)
        assert same(each.trajectories, serial.trajectories)


def test_another_process_draws_the_same(tmp_path: Path) -> None:
    """Of the checkpoint, and of the generator itself when it is pickled."""
    density = toy.mixture()
    torch.save(content_of(density), tmp_path / "mixture.ckpt")
    own_generator = df.Generator(tmp_path / "mixture.ckpt", seed=5)
    (tmp_path / "one.pickle").write_bytes(pickle.dumps(own_generator))
    code = (
        "import sys, pickle, numpy, descentflow as df; folder = sys.argv[1]\n"
        "two = df.Generator(folder + '/mixture.ckpt', seed=5), pickle.load(open(folder + '/one.pickle', 'rb'))\n"
        "drawn = [g.next_batch(9, entry_fl=350, cas_kt={290: 290}).trajectories.time_s.numpy() for g in two]\n"
        "numpy.save(folder + '/drawn.npy', numpy.stack(drawn))"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=True)
    drawn = np.load(tmp_path / "drawn.npy")
    own = own_generator.next_batch(9, entry_fl=350, cas_kt={290: 290}).trajectories.time_s.numpy()
    for theirs in drawn:
        np.testing.assert_allclose(theirs, own, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ({"cas_kt": {290: 220}}, "cas_kt"),
        ({"cas_kt": {290: (340, 350)}}, "cas_kt"),
        ({"mach": 0.6}, "mach"),
        ({"mach": (0.84, None), "cas_kt": {290: (280, 300)}}, "mach"),
        ({"time_s": 30, "level": 300}, "time_s"),
        ({"time_s": (1000, None), "level": 300}, "time_s"),
        ({"distance_nm": 3, "level": 300, "cas_kt": {290: (280, 300)}}, "distance_nm"),
        ({"time_s": 30, "level": (300, 305)}, "time_s"),
    ],
)
def test_what_no_descent_meets_is_an_error_that_names_the_nearest(asked: dict[str, object], name: str) -> None:
    own_generator = generator()
    with pytest.raises(ImplausibleError, match=f"1,000 plausible draws have .* nearest of theirs, {name}") as caught:
        own_generator.next(entry_fl=350, **asked)
    error = pickle.loads(pickle.dumps(caught.value))
    assert error.constraint == name
    printed = float(re.search(rf"nearest of theirs, {name} ([\d.]+)", str(error))[1])
    for value in (error.nearest, printed):
        descent = own_generator.next(entry_fl=350, **{**asked, name: {290: value} if name == "cas_kt" else value})
        assert len(descent) == 1


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"level": 300}, "either time_s or distance_nm"),
        ({"time_s": 100}, "a level, and either"),
        ({"time_s": 100, "distance_nm": 10, "level": 300}, "time_s and distance_nm.*leave one of them out"),
        ({"number": 1.5}, "number = 1.5; expected a whole number, from 0"),
        ({"number": "KLM204"}, "number = 'KLM204'; expected a whole number"),
        ({"time_s": (90, 100), "level": (300, 310)}, "let one of the two be a value"),
        ({"time_s": 100, "level": 360}, "below where the descent begins, FL350"),
        ({"time_s": 100, "level": 200}, "FL270"),
        ({"cas_kt": {360: 280}}, "still to be flown"),
        ({"cas_kt": (290, 280)}, r"put the least first, cas_kt=\(280, 290\)"),
        ({"cas_kt": -5}, "a number of knots, or a pair"),
        ({"mach": 280}, "a Mach number up to 1.5, or a pair of the least .* for instance mach=0.78"),
        ({"mach": float("nan")}, "mach = nan; expected a number, or a pair of the least"),
        ({"mach": "0.78"}, "mach = '0.78'; expected a number, or a pair of the least"),
        ({"cas_kt": {300: 280, 300.2: 290}}, "cas_kt twice at FL300, the nearest to level 300.2"),
        ({"context": {"wind": 3}}, "knows no context"),
    ],
)
def test_what_cannot_be_asked_is_said(asked: dict[str, object], message: str) -> None:
    refuses(ConfigError, message, generator().next, entry_fl=350, **asked)


def test_a_time_needs_a_level_of_entry() -> None:
    refuses(ConfigError, "from where time and distance count", generator().next, time_s=100, level=300)
    refuses(ConfigError, "n = 0; expected a whole number, 1 or more", generator().next_batch, 0)
    refuses(ConfigError, "flight levels above 270, up to 370", generator().next, entry_fl=450)


def test_two_values_that_one_component_of_speed_cannot_both_have() -> None:
    """Without deviations of speed, as many values as components of CAS are free; one more is what they imply."""
    density, parts = toy.mixture(), Representation.from_state(toy.state())
    held = parts.decoder.residuals
    of_drag = held.numbers[:, : len(held.drag)]
    parts.decoder.residuals = Residuals(held.drag, held.speed[:0], held.weights, of_drag, held.entry)
    density.attach(parts)
    without_deviations, levels = df.Generator(density, seed=5), (275, 300, 330, 345)
    n_cas = parts.decoder.cas_basis.n_components
    real = without_deviations.next(entry_fl=350).trajectories
    implied = {level: float(cas_kt(real, level)[0]) for level in levels[: n_cas + 1]}
    again = without_deviations.next(entry_fl=350, cas_kt=implied).trajectories
    assert all(abs(float(cas_kt(again, level)[0]) - value) < 0.01 for level, value in implied.items())
    *_, last = implied
    with pytest.raises(ImplausibleError, match="follows from what else is asked") as caught:
        without_deviations.next(entry_fl=350, cas_kt={**implied, last: implied[last] + 3})
    assert caught.value.nearest == pytest.approx(implied[last], abs=0.1)
    band = literal_eval(re.search(r"the band (\(.*\))", str(caught.value))[1])
    assert len(without_deviations.next(entry_fl=350, cas_kt={**implied, last: band})) == 1, "the advice works"


def flown_table(number: int, down_to: int) -> tuple[pl.DataFrame, object]:
    """The first part of a toy flight, and the flight."""
    real = toys.flights(12, seed=9, bottom_fl=toy.BOTTOM, top_fl=toy.TOP).subset([number])
    seen = real.mask[0] & (real.levels_fl >= down_to)
    table = {"level_fl": real.levels_fl, "CAS": real.cas_mps[0] / KT_MPS, "vertical_rate": real.rate_mps[0] / FPM_MPS}
    return pl.DataFrame({name: values[seen].numpy() for name, values in table.items()}), real


def test_what_was_flown_conditions_as_prediction_does() -> None:
    """Times to the bottom against those of the predictor; p > 1e-4 fails one right sampler in 10,000."""
    table, real = flown_table(0, 300)
    batch = generator().next_batch(800, flown=table).trajectories
    ahead = DescentPredictor(toy.mixture()).predict(real, 300.0, 800).trajectories
    assert set(batch.entry.tolist()) == {index(300)}
    for level in (0, 20):
        own, theirs = batch.time_s[:, level].numpy(), ahead.time_s[:, level].numpy()
        assert ks_2samp(own, theirs).pvalue > toy.RARE
    assert float(batch.time_s[:, 0].std()) < 0.5 * float(toy.samples(350).time_s[:, 0].std())


def test_what_was_flown_and_a_time_and_a_speed_ahead() -> None:
    """The same predictions, cut to what is asked."""
    table, real = flown_table(0, 320)
    ahead = DescentPredictor(toy.mixture()).predict(real, 320.0, 20_000).trajectories
    low, high = ahead.time_s[:, 5].quantile(torch.tensor([0.3, 0.5]).double()).tolist()
    speed = float(cas_kt(ahead, 290).median())
    kept = (ahead.time_s[:, 5] > low) & (ahead.time_s[:, 5] < high) & ((cas_kt(ahead, 290) - speed).abs() < 0.3)
    brute = ahead.subset(kept)
    batch = generator().next_batch(600, flown=table, time_s=(low, high), level=275, cas_kt={290: speed}).trajectories
    assert ks_2samp(batch.time_s[:, 5].numpy(), brute.time_s[:, 5].numpy()).pvalue > toy.RARE
    assert ks_2samp(cas_kt(batch, 275).numpy(), cas_kt(brute, 275).numpy()).pvalue > toy.RARE


def test_what_was_flown_may_be_a_sample_of_ours() -> None:
    drawn = generator().next(entry_fl=350).to_polars().filter(pl.col("level_fl") >= 320)
    ahead = generator().next(flown=drawn)
    assert ahead.to_polars()["level_fl"].max() == 320
    assert generator().next(flown=drawn.head(1)).to_polars()["level_fl"].max() == drawn["level_fl"][0]
    refuses(DataError, "no flown level on FL", generator().next, flown=drawn.with_columns(pl.col("level_fl") + 400))
    refuses(DataError, "vertical_rate", generator().next, flown=drawn.drop("vertical_rate"))
    refuses(ConfigError, "leave entry_fl out", generator().next, flown=drawn, entry_fl=350)
    refuses(ConfigError, "expected a table of levels, or its columns by name", generator().next, flown=ahead)
    refuses(DataError, "come twice, FL320", generator().next, flown=pl.concat([drawn, drawn]))
    refuses(DataError, "negative in a descent", generator().next, flown=drawn.with_columns(-pl.col("vertical_rate")))
    with pytest.raises(DataError, match=r"flown CAS of 1.. kt .* convert the columns"):
        generator().next(flown=drawn.with_columns(pl.col("CAS") * KT_MPS))
    with pytest.raises(DataError, match=r"flown vertical_rate of -.* where no training flight"):
        generator().next(flown=drawn.with_columns(pl.col("vertical_rate") * FPM_MPS))
    with pytest.raises(DataError, match=r"flown drag from CAS and vertical_rate of .* convert"):
        generator().next(flown=drawn.with_columns(pl.col("vertical_rate") * 3.28084))
    with pytest.raises(ConfigError, match="flown to FL270, the model's lowest"):
        generator().next(flown=generator().next(entry_fl=350).to_polars())
    refuses(ConfigError, "which was flown", generator().next, flown=drawn, mach=0.77)
    refuses(ConfigError, "still to be flown", generator().next, flown=drawn, cas_kt={330: 280})


@pytest.mark.parametrize("multiple", [-1, 0, float("nan"), 1e9, "much"])
def test_a_multiple_of_the_noise_that_is_none_is_refused_at_once(multiple: object) -> None:
    with pytest.raises(ConfigError, match=f"noise_multiple = '?{multiple}.*from 0.0001 to 10,000"):
        df.Generator(toy.mixture(), noise_multiple=multiple)


def test_a_context_is_given_to_the_density() -> None:
    """A Gaussian whose mean follows a number: weights of two contexts lie as far apart as its slope implies."""
    parts = replace_context(ContextEncoder.fit(pl.DataFrame({"wind": [-20.0, 0.0, 20.0]}), ["wind"]))
    d = parts.decoder.dimension
    density = GaussianDensity(d, 1)
    density.scale_tril.data = 0.3 * torch.eye(d, dtype=torch.float64)
    density.slope.data[:, 0] = 0.5
    density.attach(parts)
    given = df.Generator(density, seed=2)
    calm, windy = (given.next_batch(400, entry_fl=340, context={"wind": w}).weights for w in (0.0, 20.0))
    # 20 is one standard deviation; standard errors are 0.02, and bounds of plausibility cut a little.
    torch.testing.assert_close(windy.mean(0) - calm.mean(0), torch.full((d,), 0.5).double(), rtol=0.0, atol=0.12)
    assert given.next(entry_fl=340, context={"wind": 5}).context is not None
    refuses(ConfigError, "without a context", given.next, entry_fl=340)


def replace_context(encoder: ContextEncoder) -> object:
    parts = toy.fitted()
    parts.context = encoder
    return parts


class Slower:
    """Descents that take half as long again."""

    def apply(self, aircraft: object, flown: object, draws: object) -> object:
        return replace(flown, time_s=1.5 * flown.time_s)

    def to_state(self) -> dict[str, str]:
        return {"kind": "slower"}


def test_a_corrected_checkpoint_takes_an_entry_and_nothing_that_its_correction_would_undo() -> None:
    parts = toy.fitted()
    density = GaussianDensity(parts.decoder.dimension)
    density.attach(parts)
    before = df.Generator(density).next(entry_fl=340).trajectories.time_s
    density.representation.correction = Slower()
    corrected = df.Generator(density)
    torch.testing.assert_close(corrected.next(entry_fl=340).trajectories.time_s, 1.5 * before)
    refuses(ConfigError, "corrected checkpoint", corrected.next, entry_fl=340, cas_kt=280)


def test_the_words_say_every_constraint_and_the_samples_do_what_samples_do() -> None:
    descent = generator().next(entry_fl=350, cas_kt=290, time_s=(100, None), level=300)
    assert descent.asked == ("entry at FL350", "cas_kt 290 at FL282", "time_s at least 100 at FL300")
    assert "cas_kt 290 at FL282" in str(descent)
    assert "proposals" in str(descent)
    assert descent.placed(end=(51.47, -0.45), track=270.0).to_polars()["latitude"].is_finite().all()
    assert generator().next(mach=(0.7, 0.8)).asked == ("mach 0.7 to 0.8 at the level of entry",)
