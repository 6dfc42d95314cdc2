"""sbi: a test for a gap (`calc_misspecification_mmd`) and NPE over the sizes of effects, as its how-to pages say."""

import contextlib
import io
import logging
import warnings
from tempfile import TemporaryDirectory

import torch
from torch import Tensor

from benchmarks.rivals_measured import Measured, filled
from benchmarks.rivals_npe_simulator import Prior, simulations, summary
from benchmarks.rivals_scoring import Answer

SIGNIFICANT = 0.05
NEGLIGIBLE = 0.5
"""Of a size that matters. Sizes that cannot be below zero never have an interval with zero in it, so an interval must
lie outside a range about zero (Kruschke's region of practical equivalence)."""
SIMULATIONS = 2000
DRAWS = 10_000
HIDDEN = 50
EMBEDDED = 20


def mmd_answer(data: Measured, seed: int) -> Answer:
    """Answer of the MMD test that the real flights are the simulator's.

    The how-to page advises the embedding of a trained NPE for outputs of many numbers; the measured quantities, in
    spreads, are summary statistics already, for which the tutorial's variant in their own space is meant.
    """
    from sbi.diagnostics.misspecification import calc_misspecification_mmd

    torch.manual_seed(seed)
    simulated, real = filled(data.simulated).float(), filled(data.real).float()
    # Under its null, as many simulated flights are held against the rest of them: half of them, here.
    observed = real[torch.randperm(len(real))[: len(simulated) // 2]]
    p_value, _ = calc_misspecification_mmd(x_obs=observed, x=simulated, mode="x_space")
    return Answer(gap=bool(p_value < SIGNIFICANT), says_causes=False)


def npe_answer(data: Measured, seed: int) -> Answer:
    """Effects whose size has a posterior interval beyond what is negligible, at 0.05 over all effects together."""
    from sbi.inference import NPE
    from sbi.neural_nets import posterior_nn
    from sbi.neural_nets.embedding_nets import FCEmbedding
    from sbi.utils import BoxUniform
    from sbi.utils.tracking import TensorBoardTracker
    from torch.utils.tensorboard import SummaryWriter

    torch.manual_seed(seed)
    prior_of = Prior(data)
    prior = BoxUniform(prior_of.low, prior_of.high)
    theta, x = simulations(data, prior_of, SIMULATIONS)
    observed = summary(filled(data.real), filled(data.simulated))
    quiet = contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings(), TemporaryDirectory()
    with quiet[0], quiet[1], quiet[2] as logs, SummaryWriter(logs) as writer:
        warnings.simplefilter("ignore")
        logging.getLogger().setLevel(logging.ERROR)
        embedding = FCEmbedding(input_dim=x.shape[1], output_dim=EMBEDDED, num_layers=2, num_hiddens=HIDDEN)
        density = posterior_nn("maf", embedding_net=embedding)
        # It would write its logs into the folder where one stands.
        trainer = NPE(prior, density, tracker=TensorBoardTracker(writer), show_progress_bars=False)
        trainer.append_simulations(theta, x).train()
        # Draws outside the prior's box count as large sizes; to reject them may take for ever.
        draws = trainer.build_posterior().sample(
            (DRAWS,), x=observed, show_progress_bars=False, reject_outside_prior=False
        )
    matters = torch.tensor([effect.parameters[0].scale for effect in data.shifts.catalogue.values()])
    return posterior_answer(prior_of.names, draws[:, prior_of.first], NEGLIGIBLE * matters)


def posterior_answer(names: list[str], draws: Tensor, negligible: Tensor) -> Answer:
    """Effects (columns of draws (s, k)) whose interval lies outside what is negligible (k,), the surest first."""
    tail = SIGNIFICANT / len(names) / 2
    low, high = draws.quantile(tail, 0), draws.quantile(1 - tail, 0)
    sure = (low > negligible) | (high < -negligible)
    strength = draws.mean(0).abs() / draws.std(0)
    order = [i for i in strength.argsort(descending=True).tolist() if sure[i]]
    return Answer(tuple(frozenset({names[i]}) for i in order), gap=bool(order))
