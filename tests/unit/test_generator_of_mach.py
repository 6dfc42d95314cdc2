"""A generator of flights that hold a Mach number above a crossover of their own and a CAS below.

Laws are compared as in test_generator_law: six quantities, each with p > 1e-4.
"""

import generator_toys as toy
import numpy as np
import pytest
import torch
import toys
from generator_toys import cas_kt, cut, index, p_values, samples
from torch import Tensor

import descentflow as df
from descentflow.core.units import FPM_MPS, KT_MPS
from descentflow.generation.conditional.flown_profiles import FlownProfiles
from descentflow.generation.conditional.latent_parts import sample_profiles
from descentflow.generation.conditional.point_condition import Flown
from descentflow.generation.prediction.predictor import DescentPredictor
from descentflow.representation.decoder.trajectories import Trajectories, concatenate
from descentflow.representation.profiles import observed_profiles

CHANGING = 310
"""Level at which some flights hold their Mach number, and others their CAS."""


def compare(asked: dict[str, object], brute: Trajectories, n: int = 1000) -> df.Generator:
    found = df.Generator(toy.mixture(mach=True), seed=3).next_batch(n, **asked)
    worst = p_values(found.trajectories, brute)
    assert min(worst.values()) > toy.RARE, worst
    return found


def brute(entry_fl: int | None) -> Trajectories:
    return samples(False, entry_fl, mach=True)


def at_mach(flown: Trajectories, level_fl: float) -> Tensor:
    """Test that each descent holds its Mach number at a level: it changes less from level to level than at one CAS."""
    k = index(level_fl)
    return (flown.mach[:, k + 1] - flown.mach[:, k]).abs() < 5e-4


def test_descents_are_those_of_the_decoder() -> None:
    decoder, generator = toy.parts(True).decoder, torch.Generator().manual_seed(1)
    grid = FlownProfiles(decoder)
    u = torch.randn(200, decoder.dimension + decoder.n_white, generator=generator, dtype=torch.float64)
    weights, white = u.split([decoder.dimension, decoder.n_white], 1)
    found = Flown.of(grid, sample_profiles(decoder, grid).of(u.numpy()))
    entry, n = torch.full((200,), grid.n_levels - 1), grid.n_levels
    flown = decoder(weights, entry, white=white)
    for name, one, scale in (("cas", "cas_mps", 1e2), ("rate", "rate_mps", 10), ("mach", "mach", 1)):
        np.testing.assert_allclose(getattr(found, name)[:, :n], getattr(flown, one).numpy(), rtol=0, atol=1e-11 * scale)
    time_s = found.seconds - found.seconds[:, -1:]
    np.testing.assert_allclose(time_s, flown.time_s.numpy(), rtol=0, atol=1e-8)
    share = float(at_mach(flown, CHANGING).double().mean())
    assert 0.2 < share < 0.8


ASKED: list[dict[str, object]] = [
    {"entry_fl": 350, "cas_kt": {CHANGING: 275}},
    {"entry_fl": 350, "mach": (0.76, 0.78), "cas_kt": {290: (270, 300)}},
    {"entry_fl": 350, "time_s": (140, 160), "level": 300},
    {"mach": (None, 0.775)},
]


@pytest.mark.parametrize("asked", ASKED)
def test_a_batch_is_what_single_calls_give_to_the_bit(asked: dict[str, object]) -> None:
    one, other = (df.Generator(toy.mixture(True, True), seed=5) for _ in range(2))
    together = other.next_batch(23, **asked).trajectories
    for size in (1, 5, 17):
        first = int(one._next)
        part = one.next_batch(size, **asked).trajectories
        whole = together.subset(torch.arange(first, first + size))
        for name in ("entry", "time_s", "cas_mps", "mach", "tas_mps", "rate_mps", "drag_n"):
            assert torch.equal(getattr(part, name), getattr(whole, name))


@pytest.mark.parametrize("level", [CHANGING, 290, 345])
def test_a_speed_is_met_in_whichever_way_it_is_held(level: int) -> None:
    """Each descent is asked for the speed of one sample: one level is met in both cases, the others mostly in one."""
    middle = cas_kt(brute(350), level).median()
    like = cut(brute(350), lambda t: (cas_kt(t, level) - middle).abs() < 5)
    one, asked = df.Generator(toy.mixture(mach=True), seed=3), cas_kt(like, level)[:300]
    found = [one.next(entry_fl=350, cas_kt={level: speed}) for speed in asked.tolist()]
    flown, rest = concatenate([each.trajectories for each in found]), like.subset(torch.arange(300, len(like)))
    assert float((cas_kt(flown, level) - asked).abs().max()) < 1e-9
    assert {each.proposals for each in found} == {1}
    assert min(p_values(flown, rest).values()) > toy.RARE
    at = [at_mach(t, level).double() for t in (flown, rest)]
    spread = sum(held.var() / len(held) for held in at) ** 0.5
    assert abs(float(at[0].mean() - at[1].mean())) <= 4 * float(spread)


def test_a_speed_within_a_band() -> None:
    low, high = cas_kt(brute(350), CHANGING).quantile(torch.tensor([0.3, 0.6]).double()).tolist()
    like = cut(brute(350), lambda t: (cas_kt(t, CHANGING) > low) & (cas_kt(t, CHANGING) < high))
    compare({"entry_fl": 350, "cas_kt": {CHANGING: (low, high)}}, like)


def test_two_speeds_and_one_side_open() -> None:
    high = float(cas_kt(brute(350), 285).quantile(0.6))
    low, fast = brute(350).mach[:, index(350)].quantile(torch.tensor([0.3, 0.7]).double()).tolist()

    def meets(t: Trajectories) -> Tensor:
        return (cas_kt(t, 285) < high) & (t.mach[:, index(350)] > low) & (t.mach[:, index(350)] < fast)

    found = compare({"entry_fl": 350, "cas_kt": {285: (None, high)}, "mach": (low, fast)}, cut(brute(350), meets))
    assert float(found.effective.min()) >= 8


def test_a_mach_number_at_whatever_level_the_descent_begins() -> None:
    def own(t: Trajectories) -> Tensor:
        return t.mach.gather(1, t.entry[:, None])[:, 0]

    low, high = own(brute(None)).quantile(torch.tensor([0.5, 0.7]).double()).tolist()
    compare({"mach": (low, high)}, cut(brute(None), lambda t: (own(t) > low) & (own(t) < high)))


def test_a_time_within_a_band_and_a_speed() -> None:
    low, high = brute(350).time_s[:, 0].quantile(torch.tensor([0.5, 0.8]).double()).tolist()
    slow, fast = cas_kt(brute(350), CHANGING).quantile(torch.tensor([0.3, 0.6]).double()).tolist()

    def meets(t: Trajectories) -> Tensor:
        speed = cas_kt(t, CHANGING)
        return (t.time_s[:, 0] > low) & (t.time_s[:, 0] < high) & (speed > slow) & (speed < fast)

    asked = {"entry_fl": 350, "time_s": (low, high), "level": toy.BOTTOM, "cas_kt": {CHANGING: (slow, fast)}}
    compare(asked, cut(brute(350), meets))


def test_a_time_at_a_level() -> None:
    """Each descent is asked for the time of one sample, so that both have the same times."""
    times = brute(350).time_s[:, index(290)]
    like = cut(brute(350), lambda t: (t.time_s[:, index(290)] - times.median()).abs() < 2)
    one, asked = df.Generator(toy.mixture(mach=True), seed=3), like.time_s[:150, index(290)].tolist()
    flown = concatenate([one.next(entry_fl=350, time_s=time_s, level=290).trajectories for time_s in asked])
    assert min(p_values(flown, like.subset(torch.arange(150, len(like)))).values()) > toy.RARE
    assert float((flown.time_s[:, index(290)] - torch.tensor(asked)).abs().max()) <= 0.05


@pytest.mark.parametrize("from_fl", [340, 285])
def test_what_was_flown_conditions_as_prediction_does(from_fl: int) -> None:
    """Of a flight that is still at its Mach number, and of one at its CAS already."""
    drawn, k = brute(350).subset(torch.arange(40)), index(from_fl)
    levels, mask = drawn.levels_fl, drawn.mask & (drawn.levels_fl >= from_fl)
    names, rest = tuple(map(str, range(40))), (drawn.time_s, drawn.cas_mps, drawn.rate_mps, mask)
    flights = observed_profiles(toys.AIRCRAFT, names, levels, *rest, speed="mach_cas")
    assert flights.crossovers is not None
    fits = flights.crossovers.sure[:, k] & (flights.crossovers.holds_mach[:, k] == (from_fl == 340))
    one = flights.subset(torch.nonzero(fits)[:1, 0])
    seen = one.mask[0].nonzero()[:, 0]
    flown = {
        "level_fl": one.levels_fl[seen].tolist(),
        "CAS": (one.cas_mps[0, seen] / KT_MPS).tolist(),
        "vertical_rate": (one.rate_mps[0, seen] / FPM_MPS).tolist(),
    }
    density = toy.mixture(mach=True)
    found = df.Generator(density, seed=3).next_batch(1000, flown=flown).trajectories
    ahead = DescentPredictor(density).predict(one, float(from_fl), n=1000, seed=0).trajectories
    assert min(p_values(found, ahead).values()) > toy.RARE
    assert bool(at_mach(found, from_fl).all()) is (from_fl == 340)
