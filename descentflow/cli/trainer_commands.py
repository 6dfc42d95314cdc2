"""`descentflow fit`, `validate`, `test` and `predict`: what LightningCLI runs, with a help that fits on a screen."""

from collections.abc import Callable
from importlib import import_module
from inspect import getdoc


def fit(words: list[str]) -> None:
    """Train a generator of descents.

    usage: descentflow fit [--config FILE ...] [--model NAME] --data.descents FILE [options]

    Options come from YAML files (--config, several are layered in order), then from the command line. Everything is
    written under runs/NAME/version_N: checkpoints/best.ckpt (of the best epoch, with flights held out, to score),
    checkpoints/final.ckpt (the same fitted again to all flights, to sample), checkpoints/last.ckpt, config.yaml and
    TensorBoard's events (tensorboard --logdir runs).

    what to train
      --model NAME                   gaussian, mixture or flow, the name of a class, with its defaults, or
                                     FILE.py, a density of your own, which is run
      --config FILE                  YAML; these come along: gaussian, gmm, gmm_svi, flow (good settings for
                                     each), gmm_paper, flow_paper, paper (the paper's recipe), and
                                     configs/experiment/quickstart.yaml (complete)
    on what
      --data.descents FILE           prepared descents (descentflow prepare)
      --data.aircraft TYPE           coefficients that infer and fly the drag, where several types are pooled
      --data.bada_dir DIR            a licence holder's BADA 3 or 4 instead of the embedded open aircraft
      --data.typecodes [A320,A321]   only these types
      --data.split_by aircraft       never put flights of one aircraft on both sides of the split
      --data.context [hour,operator] condition on columns of the descents, of a table, or on entry_fl, hour and
                                     operator (from the callsign), which need none
      --data.context_table FILE      columns of context by flight_id, CSV or Parquet
      --data.explained_variance 0.8  share of variance that the fPCA components of drag explain
      --data.cas_explained_variance 0.95
                                     the same of CAS
      --final false                  no final.ckpt; halves the time
    how long
      --trainer.max_epochs N
      --trainer.logger.name NAME     folder under runs/
      --ckpt_path FILE               resume a killed run from its checkpoints/last.ckpt (with its own config.yaml)
      --quiet                        show no progress; it goes to stderr, after two seconds

    `descentflow fit --help_all` lists every option; `descentflow fit ... --print_config` prints the resolved settings.
    """
    import_module("descentflow.cli.lightning_cli").run("fit", words)


def validate(words: list[str]) -> None:
    """Print the log-likelihood of a checkpoint on its validation flights.

    usage: descentflow validate --ckpt_path FILE [--data.descents FILE] [options]

    The run's own config.yaml, found in the folder of its run, is read first; --config FILE replaces it.

      --ckpt_path FILE               checkpoint that `descentflow fit` wrote
      --data.descents FILE           other prepared descents: their flights are test flights unless the checkpoint was
                                     trained on them
      --quiet                        show no progress; it goes to stderr, after two seconds

    `descentflow validate --help_all` lists every option.
    """
    import_module("descentflow.cli.lightning_cli").run("validate", words)


def test(words: list[str]) -> None:
    """Score a checkpoint against held-out flights: log-likelihood, scores.csv, figures, TensorBoard."""
    import_module("descentflow.cli.lightning_cli").run("test", words)


def predict(words: list[str]) -> None:
    """Write the log-likelihood of each held-out flight to log_prob.csv: the smaller, the less usual."""
    import_module("descentflow.cli.lightning_cli").run("predict", words)


COMMANDS: dict[str, Callable[[list[str]], None]] = {
    command.__name__: command for command in (fit, validate, test, predict)
}


def text(name: str) -> str:
    """Help of one of the commands.

    Example:
        >>> print(text("predict").splitlines()[2])
        usage: descentflow predict --ckpt_path FILE [--data.descents FILE] [options]
    """
    own = getdoc(COMMANDS[name]) or ""
    shared = (getdoc(validate) or "").replace("descentflow validate", f"descentflow {name}")
    return own if "usage" in own else f"{own}\n{shared.partition(chr(10))[2]}"
