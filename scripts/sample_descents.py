"""Sample descents from a checkpoint in Python: python scripts/sample_descents.py CKPT [N] [SEED]."""

import sys

import torch

from descentflow.generation.sample import sample


def main(checkpoint: str, n: int = 1000, seed: int = 0) -> None:
    samples = sample(checkpoint, n, seed=seed)
    print(samples)
    print(samples.to_polars().head())

    flown = samples.trajectories
    whole = flown.entry == len(flown.levels_fl) - 1
    minutes = flown.time_s[whole, 0] / 60
    print(f"{int(whole.sum())} descents from FL{flown.levels_fl[-1]:.0f} to FL{flown.levels_fl[0]:.0f} take")
    low, middle, high = torch.quantile(minutes, torch.tensor([0.05, 0.5, 0.95]).to(minutes)).tolist()
    print(f"{middle:.1f} min (90 % between {low:.1f} and {high:.1f} min)")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
