"""Fits from the command line that several test files share."""

from pathlib import Path

from descentflow.cli.entry import main

CONFIGS = Path(__file__).resolve().parents[1] / "descentflow" / "configs"
QUICK = ["--trainer.enable_progress_bar=false", "--trainer.enable_model_summary=false", "--scores.n_samples=200"]


def fit(folder: Path, descents: Path, model: str, *more: str) -> Path:
    """Fit with a shipped config, in a folder of its own; returns the run's folder."""
    settings = ["--config", str(CONFIGS / "model" / f"{model}.yaml"), "--data.descents", str(descents)]
    where = ["--trainer.logger.init_args.save_dir", str(folder / "runs")]
    assert main(["fit", *settings, *where, *QUICK, *more]) == 0
    return next((folder / "runs" / model).iterdir())
