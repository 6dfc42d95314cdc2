"""The paper's study in little: it resumes, its tables add up, its figures and intervals show what they are said to."""

import shutil
from pathlib import Path

import polars as pl
import pytest
import torch
import toys
from jinja2 import UndefinedError
from refusals import refuses

from descentflow.core.errors import ConfigError
from descentflow.core.units import FL_M, KT_MPS
from descentflow.core.workers import engine_of
from descentflow.densities.checkpoint import load_model
from descentflow.evaluation.metrics.descent_set import DescentSet
from descentflow.evaluation.metrics.scores import score
from descentflow.physics.nominal_descent import nominal_descent
from descentflow.reporting.pages import rendered
from descentflow.representation.fpca.gappy import fit_components
from descentflow.training.datamodule import DescentDataModule
from studies.paper.figures.mass_range import N_MASSES, mass_range
from studies.paper.score_intervals import score_intervals
from studies.paper.study_plan import PAPER_FLIGHTS, StudyPlan, begin, paper_plan
from studies.paper.study_report import write_report
from studies.paper.study_run import run_study
from studies.paper.study_tables import all_scores
from studies.paper.sweep_report import sweep_sections
from studies.paper.sweeps import NAMES, SweepPlan, run_sweeps
from studies.paper.variance import truncated
from studies.process_engine import processes

PLAN = StudyPlan({"A320": 160, "DH8D": 160, "BE20": 160}, models=("gaussian", "gmm"), n_samples=300, max_epochs=2)


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    begin(PLAN, folder)
    run_study(PLAN, folder, processes(1), lambda _: None)
    write_report(PLAN, folder)
    return folder


def test_every_type_and_model_has_its_fifteen_scores(study: Path) -> None:
    scores = all_scores(PLAN, study)
    assert scores.group_by("typecode", "model").len()["len"].to_list() == [15] * 6
    below = scores.filter(pl.col("quantity") == "cas_below_transition")
    assert below["score"].is_not_null().all()
    assert (below["low"] <= below["score"]).all()
    assert (below["high"] > below["score"]).all()


def test_a_study_goes_on_where_it_was_killed_with_the_same_results(study: Path) -> None:
    """Without a model and with half a fit left over, a Dask worker fits it again, and the page is the same."""
    before = (study / "report.html").read_bytes()
    untouched = (study / "A320" / "gmm" / "model.ckpt").stat().st_mtime_ns
    for name in ("model.ckpt", "done", "scores.csv"):
        (study / "BE20" / "gaussian" / name).unlink()
    # What a killed fit leaves: a checkpoint under its temporary name, and a log without an end.
    (study / "BE20" / "gaussian" / ".model-stray.ckpt").write_bytes(b"half a checkpoint")
    (study / "BE20" / "gaussian" / "fit.log").write_text("flights: ")
    begin(PLAN, study)
    said: list[str] = []
    run_study(PLAN, study, engine_of("dask", 1), said.append)
    assert said == ["first model: 1 of 1 done (2 were there); last BE20 gaussian"]
    write_report(PLAN, study)
    assert (study / "A320" / "gmm" / "model.ckpt").stat().st_mtime_ns == untouched
    assert (study / "report.html").read_bytes() == before
    assert load_model(study / "BE20" / "gaussian" / "model.ckpt").sample(3, seed=0).shape[0] == 3


# The sweep compares the paper's fPCA, whose variance grows on few flights as it does on many; it says so.
@pytest.mark.filterwarnings("ignore:after .* iterations the paper's fPCA:descentflow.core.errors.DescentflowWarning")
def test_sweeps_leave_a_file_a_job_go_on_and_show_in_the_page(study: Path) -> None:
    plan = StudyPlan({"BE20": 160}, models=PLAN.models, n_samples=300)
    sweep = SweepPlan(flights=90, shares=(0.5, 0.8), folds=2, flows=(1, 5), hidden=(2,), max_epochs=1)
    said: list[str] = []
    run_sweeps(plan, sweep, study, NAMES, processes(1), said.append)
    assert [line for line in said if "2 of 2" in line or "1 of 1" in line] == [
        f"sweep {name}: {n} of {n} done (0 were there)" for name, n in (("variance", 2), ("gappy", 1), ("flow", 2))
    ]
    scores = pl.concat([pl.read_csv(study / "sweeps" / "variance" / f"BE20-{fold}.csv") for fold in range(2)])
    assert scores.group_by("share", "fold").len()["len"].to_list() == [6] * 4
    assert scores.filter(pl.col("share") == 0.5)["components"].max() < scores["components"].max()  # type: ignore[operator]
    before = (study / "sweeps" / "variance" / "BE20-1.csv").read_bytes()
    (study / "sweeps" / "variance" / "BE20-1.csv").unlink()
    run_sweeps(plan, sweep, study, ("variance",), processes(1), said.append)
    assert said[-1] == "sweep variance: 1 of 1 done (1 were there)"
    assert (study / "sweeps" / "variance" / "BE20-1.csv").read_bytes() == before
    sections = dict(sweep_sections(plan, study))
    assert len(sections) == 3
    assert all("<table>" in html and "data:image/png" in html for html in map("".join, sections.values()))
    shutil.rmtree(study / "sweeps" / "flow")
    assert len(sweep_sections(plan, study)) == 2
    refuses(ConfigError, "sweeps colours", run_sweeps, plan, sweep, study, ("colours",), processes(1), said.append)
    refuses(ConfigError, "another plan", run_sweeps, plan, SweepPlan(), study, NAMES, processes(1), said.append)
    shutil.rmtree(study / "sweeps")


def test_the_likelihoods_are_those_of_the_held_out_flights(study: Path) -> None:
    data = DescentDataModule(study / "A320" / "descents.parquet", checkpoint=study / "A320" / "gmm" / "model.ckpt")
    data.setup()
    nll_of = dict(pl.read_csv(study / "A320" / "nll.csv").select("model", "nll").iter_rows())
    for name in PLAN.models:
        with torch.no_grad():
            nll = -load_model(study / "A320" / name / "model.ckpt").log_observed(data.evidence("test")).mean()
        assert nll_of[name] == pytest.approx(float(nll), rel=1e-9)


def test_the_papers_counts_and_impossible_plans() -> None:
    assert sum(PAPER_FLIGHTS.values()) == 116_066
    assert paper_plan(0.1, ["B738", "BE20"]).flights == {"B738": 4101, "BE20": 150}
    refuses(ConfigError, "Concorde", paper_plan, 1.0, ["Concorde"])
    refuses(ConfigError, "models diffusion", StudyPlan, {"A320": 100}, models=("diffusion",))
    refuses(ConfigError, "50 flights", StudyPlan, {"A320": 10})


AIRCRAFT = toys.AIRCRAFT


def test_flights_that_are_badas_own_are_explained_by_mass_and_slower_ones_are_not() -> None:
    levels = torch.arange(150.0, 361.0, dtype=torch.float64)
    masses = torch.linspace(float(AIRCRAFT.mass_minimum_kg), float(AIRCRAFT.mass_maximum_kg), 12).double()
    sets = [DescentSet.of_nominal(nominal_descent(AIRCRAFT, levels, float(mass))) for mass in masses[1:-1]]
    columns = {
        name: torch.cat([getattr(one, name) for one in sets])
        for name in ("time_s", "cas_mps", "rate_mps", "drag_n", "mask")
    }
    own = DescentSet(levels, **columns)
    slower = DescentSet(levels, **{**columns, "time_s": 2 * columns["time_s"]})
    assert mass_range(own, AIRCRAFT).explained == 1
    found = mass_range(slower, AIRCRAFT)
    assert found.explained == 0
    assert found.nominal_time_s.shape == (N_MASSES, len(levels))
    assert found.range_s[0] < float(found.reference_time_s[0]) < found.range_s[1]


def sets(n: int, seed: int) -> DescentSet:
    return DescentSet.of_profiles(toys.flights(n, seed, top_fl=190))


def test_the_width_is_that_of_a_mean_over_flights() -> None:
    """Error of the mean CAS with samples 20 kt away: its deviation is that of the flights' mean, in closed form."""
    samples, real = sets(3000, 1), sets(200, 2)
    samples.cas_mps.add_(20 * KT_MPS)
    table = score(samples, real, 170.0, n_splits=1)
    intervals = {(i.quantity, i.statistic): i for i in score_intervals(table, samples, real, 170.0, n_resamples=200)}
    interval = intervals["cas_below_transition", "mae"]
    below = real.levels_fl <= 170
    mean_by_flight = (real.cas_mps[:, below] / KT_MPS).mean(1)
    expected = 2 * 1.645 * float(mean_by_flight.std()) / 200**0.5
    # 200 resamples tell a standard deviation to 5 %; few flights of these lack a level.
    assert interval.high - interval.low == pytest.approx(expected, rel=0.2)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.9])
def test_a_truncated_basis_is_the_one_that_a_fit_of_its_own_finds(share: float) -> None:
    real = toys.flights(120)
    whole, own = (fit_components(real.cas_mps, real.mask, FL_M, s) for s in (0.95, share))
    short = truncated(whole, share)
    assert short.n_components == own.n_components <= whole.n_components
    for name, buffer in own.named_buffers():
        torch.testing.assert_close(getattr(short, name), buffer, rtol=0, atol=0)


def test_a_name_that_a_template_does_not_get_is_an_error() -> None:
    refuses(UndefinedError, "report", rendered, "surveillance/cleaning_page.html.j2", flights=[])
