"""Descents that meet constraints have the law of unconditional samples that happen to meet them.

Every comparison is a two-sample Kolmogorov-Smirnov test of six quantities with p > 1e-4 each: one right sampler in some
2,000 fails one. Where as many speeds are asked as the model has weights of speed, or a band is as narrow as residuals
are, the residuals of neighbours are no exact law of those that meet it: the distance must then be below 0.1. A value is
compared with samples within a band so narrow that the law hardly changes across it.
"""

import generator_toys as toy
import torch
from generator_toys import cas_kt, comparisons, cut, distance_nm, index, p_values, samples
from toys import Opaque

import descentflow as df
from descentflow.representation.decoder.trajectories import Trajectories, concatenate

N = 1500


def compare(asked: dict[str, object], brute: Trajectories, *, n: int = N, within: float = 0.0) -> df.Generator:
    batch = df.Generator(toy.mixture(), seed=3).next_batch(n, **asked)
    compared = comparisons(batch.trajectories, brute)
    assert all(distance < within or p > toy.RARE for distance, p in compared.values()), compared
    return batch


def test_nothing_asked_is_sampling() -> None:
    compare({}, samples(None))


def test_a_level_of_entry() -> None:
    compare({"entry_fl": 350}, samples(350))


def test_a_speed() -> None:
    brute = cut(samples(350), lambda t: (cas_kt(t, 290) - 290).abs() < 0.5)
    compared = compare({"entry_fl": 350, "cas_kt": {290: 290}}, brute)
    assert float((cas_kt(compared.trajectories, 290) - 290).abs().max()) < 1e-9
    assert compared.proposals == 1


def test_a_speed_within_a_band() -> None:
    brute = cut(samples(350), lambda t: (cas_kt(t, 290) > 280) & (cas_kt(t, 290) < 295))
    compared = compare({"entry_fl": 350, "cas_kt": {290: (280, 295)}}, brute)
    assert compared.proposals == 1


def test_two_speeds_and_one_side_open() -> None:
    def meets(t: Trajectories) -> torch.Tensor:
        return (cas_kt(t, 280) < 300) & (t.mach[:, index(350)] > 0.765) & (t.mach[:, index(350)] < 0.78)

    compared = compare(
        {"entry_fl": 350, "cas_kt": {280: (None, 300)}, "mach": (0.765, 0.78)}, cut(samples(350), meets), within=0.1
    )
    assert compared.proposals > 1
    assert float(compared.effective.min()) >= 8


def test_a_mach_number_at_whatever_level_the_descent_begins() -> None:
    def meets(t: Trajectories) -> torch.Tensor:
        own = t.mach.gather(1, t.entry[:, None])[:, 0]
        return (own > 0.77) & (own < 0.775)

    compare({"mach": (0.77, 0.775)}, cut(samples(None), meets), within=0.1)


def test_a_time_at_a_level() -> None:
    """Each descent is asked for the time of one sample, so that both have the same times."""
    times = samples(350).time_s[:, index(305)]
    brute = cut(samples(350), lambda t: (t.time_s[:, index(305)] - times.median()).abs() < 2)
    own_generator, asked = df.Generator(toy.mixture(), seed=3), brute.time_s[:400, index(305)].tolist()
    descents = [own_generator.next(entry_fl=350, time_s=time_s, level=305) for time_s in asked]
    flown = concatenate([each.trajectories for each in descents])
    assert min(p_values(flown, brute.subset(torch.arange(400, len(brute)))).values()) > toy.RARE
    assert float((flown.time_s[:, index(305)] - torch.tensor(asked)).abs().max()) < 1e-3
    assert min(float(each.effective.min()) for each in descents) > 10


def test_a_time_within_a_band_and_a_speed() -> None:
    times = samples(350).time_s[:, 0]
    low, high = float(times.quantile(0.7)), float(times.quantile(0.9))

    def meets(t: Trajectories) -> torch.Tensor:
        return (t.time_s[:, 0] > low) & (t.time_s[:, 0] < high) & ((cas_kt(t, 290) - 285).abs() < 1)

    compare({"entry_fl": 350, "time_s": (low, high), "level": 270, "cas_kt": {290: 285}}, cut(samples(350), meets))


def test_a_distance_at_a_level() -> None:
    low, high = distance_nm(samples(350), 290).quantile(torch.tensor([0.2, 0.3]).double()).tolist()
    brute = cut(samples(350), lambda t: (distance_nm(t, 290) > low) & (distance_nm(t, 290) < high))
    compare({"entry_fl": 350, "distance_nm": (low, high), "level": 290}, brute)


def test_a_level_within_a_band_at_a_time() -> None:
    at_310 = float(samples(350).time_s[:, index(310)].quantile(0.4))
    brute = cut(samples(350), lambda t: (t.time_s[:, index(305)] > at_310) & (t.time_s[:, index(312)] < at_310))
    compare({"entry_fl": 350, "time_s": at_310, "level": (305, 312)}, brute)


def test_a_density_that_is_no_mixture() -> None:
    """Gaussians fitted to its draws propose, its log density decides."""
    generator = df.Generator(Opaque(toy.mixture()), seed=3)
    free = generator.next_batch(1000, entry_fl=350)
    assert min(p_values(free.trajectories, samples(350)).values()) > toy.RARE
    brute = cut(samples(350), lambda t: (cas_kt(t, 290) - 290).abs() < 0.5)
    asked = generator.next_batch(500, entry_fl=350, cas_kt={290: 290})
    assert min(p_values(asked.trajectories, brute).values()) > toy.RARE
    assert asked.proposals > 1
