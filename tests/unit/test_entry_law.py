"""The law of the normals behind a Gaussian or a flow by bins of the entry level: its density, draws and learning."""

from copy import deepcopy
from pathlib import Path

import pytest
import torch
import toys
from graph_toys import PARTS, density
from scipy.stats import ks_1samp, norm
from torch import Tensor
from torch.distributions import Categorical, MixtureSameFamily, MultivariateNormal

from descentflow.core.errors import CheckpointError
from descentflow.densities.checkpoint import content_of, density_of, load_model
from descentflow.densities.entry_law import EntryLaw
from descentflow.densities.flow import FlowDensity
from descentflow.densities.gaussian import GaussianDensity
from descentflow.densities.learn_entry_law import learn_entry_law
from descentflow.densities.transformed import TransformedDensity
from descentflow.generation.rejection import sample_descents
from descentflow.representation.evidence import Evidence
from descentflow.representation.read_checkpoint import SECTION
from descentflow.training.fit import fit
from descentflow.training.models import Gaussian, MaskedAffineFlow

KINDS = ["gaussian by entry", "whitened flow by entry"]
ENTRY = torch.tensor([170, 171])
"""The highest level of the lower bin, and the lowest of the upper one."""


def of(kind: str) -> TransformedDensity:
    found = density(kind, PARTS).double()
    assert isinstance(found, TransformedDensity)
    return found


def law_of(model: TransformedDensity) -> EntryLaw:
    assert model.entry_law is not None
    return model.entry_law


@pytest.mark.parametrize("kind", KINDS)
def test_the_density_is_that_of_both_bins_mixed(kind: str) -> None:
    model, weights = of(kind), 0.7 * torch.randn(50, PARTS.decoder.dimension).double()
    of_bins = torch.stack([model.log_prob_entering(weights, entry.repeat(50)) for entry in ENTRY], 1)
    mixed = (of_bins + law_of(model).shares.log()).logsumexp(1)
    torch.testing.assert_close(model.log_prob(weights), mixed, rtol=0, atol=1e-12)


def test_a_gaussian_in_each_bin_is_a_mixture_of_gaussians() -> None:
    model, weights = of("gaussian by entry"), torch.randn(50, PARTS.decoder.dimension).double()
    mixture = model.mixture
    assert mixture is not None
    theirs = MixtureSameFamily(
        Categorical(mixture.probs), MultivariateNormal(mixture.locs, scale_tril=mixture.scale_trils)
    )
    torch.testing.assert_close(model.log_prob(weights), theirs.log_prob(weights), rtol=1e-12, atol=1e-12)
    assert mixture.n_components == 2


@pytest.mark.parametrize("kind", ["gaussian by entry", "whitened flow by entry", "plain flow"])
def test_the_log_determinant_is_autograds(kind: str) -> None:
    model = of(kind)
    weights = 0.7 * torch.randn(5, model.dimension).double()
    white, log_det = model.to_white(weights)
    jacobians = torch.autograd.functional.jacobian(lambda w: model.to_white(w)[0].sum(0), weights).transpose(0, 1)
    torch.testing.assert_close(torch.linalg.slogdet(jacobians)[1], log_det, rtol=0, atol=1e-8)
    torch.testing.assert_close(model.of_white(white), weights, rtol=0, atol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
def test_draws_of_a_bin_have_its_normals(kind: str) -> None:
    """Kolmogorov-Smirnov of every whitened number; p > 1e-5 in each of some 20 fails one right sampler in 5,000."""
    model = of(kind)
    law = law_of(model)
    for k in range(2):
        normals = model.to_white(model.sample_of(torch.full((4_000,), k), seed=k))[0]
        white = torch.linalg.solve_triangular(law.root[k], (normals - law.shift[k]).T, upper=False)
        assert min(ks_1samp(row.numpy(), norm.cdf).pvalue for row in white) > 1e-5


@pytest.mark.parametrize("kind", KINDS)
def test_draws_of_all_flights_have_the_shares_of_the_bins(kind: str) -> None:
    """The mean of all normals, to five standard errors."""
    model, n = of(kind), 20_000
    normals, law = model.to_white(model.sample(n, seed=0))[0], law_of(model)
    error = normals.std(0) / n**0.5
    assert bool(((normals.mean(0) - law.shares @ law.shift).abs() < 5 * error).all())


@pytest.mark.parametrize("kind", KINDS)
def test_samples_are_of_the_bin_in_which_they_enter(kind: str) -> None:
    """Before rejection: mean weights of samples from either level are those of the bin, to five standard errors."""
    model = density(kind, PARTS)
    assert isinstance(model, TransformedDensity)
    everywhere = deepcopy(PARTS)  # a state read again shares its tensors
    wide = everywhere.plausibility
    for name in ("drag_low", "cas_low"):
        getattr(wide, name).fill_(-1e9)
    for name in ("drag_high", "cas_high"):
        getattr(wide, name).fill_(1e9)
    for name in ("slowest_rate_mps", "fastest_change_mps2", "fastest_rate_change_mps2"):
        getattr(wide, name).fill_(1e9)
    for k, entry in enumerate(ENTRY):
        found = sample_descents(model, everywhere, 4_000, seed=0, entry=entry[None]).weights
        expected = model.sample_of(torch.full((4_000,), k), seed=5).double()
        error = (found.var(0) / 4_000 + expected.var(0) / 4_000).sqrt()
        assert bool(((found.mean(0) - expected.mean(0)).abs() < 5 * error).all())


def planted(n: int, seed: int) -> tuple[Tensor, Tensor]:
    """Entry levels of n flights and their weights: N(-0.5, I) below the middle, N(0.5, I) above."""
    generator = torch.Generator().manual_seed(seed)
    entry = torch.randint(0, 200, (n,), generator=generator)
    weights = torch.randn(n, 3, generator=generator, dtype=torch.float64)
    return entry, weights + torch.where(entry < 100, -0.5, 0.5)[:, None].double()


def gappy(weights: Tensor, seed: int) -> Evidence:
    """Each flight seen to within 0.3, a third of them without their last number."""
    n, d = weights.shape
    generator = torch.Generator().manual_seed(seed)
    group = (torch.arange(n) % 3 == 0).long()
    precisions = torch.eye(d).double().repeat(2, 1, 1) / 0.09
    precisions[1, -1, -1] = 0.0
    seen = weights + 0.3 * torch.randn(n, d, generator=generator, dtype=torch.float64)
    return Evidence.of_information(precisions, (precisions[group] @ seen[..., None])[..., 0], group)


def overall(weights: Tensor) -> GaussianDensity:
    """The Gaussian of all flights."""
    found = GaussianDensity(weights.shape[1])
    found.loc.data = weights.mean(0)
    found.scale_tril.data = torch.linalg.cholesky(torch.cov(weights.T))
    return found


@pytest.mark.parametrize("known", [True, False])
def test_planted_means_are_found_whatever_is_hidden(known: bool) -> None:
    entry, weights = planted(2_000, seed=1)
    evidence = Evidence.of_weights(weights) if known else gappy(weights, seed=2)
    model = overall(weights)
    law = learn_entry_law(model, evidence, entry)
    assert law is not None
    means = model.loc + law.shift @ model.scale_tril.T
    expected = torch.tensor([-0.5, -0.5, 0.5, 0.5]).double()[:, None].expand(-1, 3)
    # A bin of 500 flights knows a mean to 0.045; draws and shrinkage (a tenth) besides.
    torch.testing.assert_close(means, expected, rtol=0, atol=0.2)
    within = torch.stack([model.scale_tril @ root @ root.T @ model.scale_tril.T for root in law.root])
    torch.testing.assert_close(within, torch.eye(3).double().expand(4, -1, -1), rtol=0, atol=0.3)


def test_flights_that_do_not_differ_keep_one_law_or_hardly_another() -> None:
    """Of 20 sets without a difference: what is learnt by chance moves no bin's mean by more than 0.15."""
    learnt = []
    for seed in range(20):
        entry, weights = planted(1_000, seed)
        weights = weights[torch.randperm(1_000, generator=torch.Generator().manual_seed(seed))]
        law = learn_entry_law(overall(weights), Evidence.of_weights(weights), entry)
        learnt.append(0.0 if law is None else float(law.shift.abs().max()))
    assert max(learnt) < 0.15
    assert learnt.count(0.0) >= 10


def test_flights_of_one_level_of_entry_have_no_law() -> None:
    _, weights = planted(100, seed=0)
    assert learn_entry_law(overall(weights), Evidence.of_weights(weights), torch.full((100,), 150)) is None


@pytest.mark.parametrize("kind", KINDS)
def test_a_checkpoint_keeps_it(kind: str) -> None:
    model = density(kind, PARTS)
    again = density_of(content_of(model)[SECTION])
    assert isinstance(again, TransformedDensity)
    again.load_state_dict(model.state_dict())
    components = torch.tensor([0, 1, 1])
    assert torch.equal(again.sample_of(components, seed=0), model.sample_of(components, seed=0))  # type: ignore[operator]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("shares", [0.4, 0.4]),
        ("shares", [1.4, -0.4]),
        ("edges", [170, 171]),
        ("shift", [[float("nan")] * PARTS.decoder.dimension] * 2),
        ("root", [[[0.0] * PARTS.decoder.dimension] * PARTS.decoder.dimension] * 2),
    ],
)
def test_a_law_that_is_none_is_refused(name: str, value: object, tmp_path: Path) -> None:
    content = content_of(density("gaussian by entry", PARTS))
    content[SECTION]["settings"]["entry_law"][name] = value
    torch.save(content, tmp_path / "model.ckpt")
    with pytest.raises(CheckpointError, match="entry law"):
        load_model(tmp_path / "model.ckpt")


@pytest.fixture(scope="module")
def descents(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("entry") / "descents.parquet"
    toys.write_descents_file(path, 200)
    return path


@pytest.mark.parametrize("kind", [Gaussian, MaskedAffineFlow])
def test_a_density_may_be_without(descents: Path, tmp_path: Path, kind: type[Gaussian | MaskedAffineFlow]) -> None:
    fit(descents, kind(by_entry=False), out=tmp_path / "model.ckpt", max_epochs=2)
    assert load_model(tmp_path / "model.ckpt").entry_law is None  # type: ignore[attr-defined]


def test_a_flow_is_trained_as_the_density_of_all_flights(descents: Path) -> None:
    """With and without the law the same parameters."""
    with_it, without = (fit(descents, MaskedAffineFlow(by_entry=by), max_epochs=4, seed=1) for by in (True, False))
    assert isinstance(with_it.density, FlowDensity)
    for one, other in zip(with_it.density.parameters(), without.density.parameters(), strict=True):
        assert torch.equal(one, other)


def test_bins_that_lie_further_apart_than_all_flights_spread_are_not_believed() -> None:
    """Of a dozen flights far from a standard normal: priors of few flights have no law, and one of many has."""
    generator = torch.Generator().manual_seed(0)
    entry = torch.arange(12)
    weights = torch.randn(12, 3, generator=generator).double() + torch.where(entry < 6, -9.0, 9.0)[:, None]
    law = learn_entry_law(GaussianDensity(3), Evidence.of_weights(weights), entry)
    assert law is not None
    assert bool(law.shift.isfinite().all() & (law.shift.abs() < 1).all())
    assert bool((law.root.diagonal(dim1=-2, dim2=-1) > 0).all())
