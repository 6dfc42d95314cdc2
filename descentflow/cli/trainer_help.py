"""Short help for the trainer's commands, whose full help takes seconds to import and runs to hundreds of lines."""

FIT = """usage: descentflow fit [--config FILE ...] [--model NAME] --data.descents FILE [options]

Train a generator of descents. Options come from YAML files (--config, several are layered in order), then from
the command line. Everything is written under runs/NAME/version_N: checkpoints/best.ckpt (of the best epoch, with
flights held out, to score), checkpoints/final.ckpt (the same fitted again to all flights, to sample),
checkpoints/last.ckpt, config.yaml and TensorBoard's events (tensorboard --logdir runs).

what to train
  --model NAME                   Gaussian, GaussianMixture, MaskedAffineFlow or SplineFlow
  --config FILE                  YAML; these come along: gaussian, gmm, gmm_svi, flow, spline (good settings for each),
                                 gmm_paper, flow_paper, paper (the paper's recipe), and
                                 configs/experiment/quickstart.yaml (complete)
on what
  --data.descents FILE           prepared descents (descentflow prepare)
  --data.aircraft TYPE           whose coefficients infer and fly the drag, where descents of several types are pooled
  --data.bada_dir DIR            a licence holder's BADA 3 files instead of the embedded open aircraft
  --data.typecodes [A320,A321]   only these types
  --data.split_by aircraft       never put flights of one aircraft on both sides of the split
  --data.context [hour,operator] condition on columns of the descents, of a table, or on entry_fl, hour and operator
                                 (from the callsign), which need none
  --data.context_table FILE      columns of context by flight_id, CSV or Parquet
  --data.explained_variance 0.8  share of variance that the fPCA components of drag explain
  --data.cas_explained_variance 0.95
                                 the same of CAS; if absent 0.95 of 150 training flights and more
  --final false                  no final.ckpt; halves the time
how long
  --trainer.max_epochs N
  --trainer.logger.name NAME     folder under runs/
  --ckpt_path FILE               resume a killed run from its checkpoints/last.ckpt (with its own config.yaml)
  --quiet                        show no progress; it goes to stderr, after two seconds

`descentflow fit --help_all` lists every option; `descentflow fit ... --print_config` prints the resolved settings.
"""

OTHER = """usage: descentflow {name} --ckpt_path FILE [--data.descents FILE] [options]

{purpose}
The run's own config.yaml, found beside the checkpoint, is read first; --config FILE replaces it.

  --ckpt_path FILE               checkpoint that `descentflow fit` wrote
  --data.descents FILE           other prepared descents: their flights are test flights unless the checkpoint was
                                 trained on them
  --quiet                        show no progress; it goes to stderr, after two seconds

`descentflow {name} --help_all` lists every option.
"""

PURPOSES = {
    "validate": "Log-likelihood of a checkpoint on its validation flights.",
    "test": "Score a checkpoint against held-out flights: log-likelihood, scores.csv, figures, TensorBoard.",
    "predict": "Log-likelihood of each held-out flight, written to log_prob.csv: the smaller, the less usual.",
}


def text(name: str) -> str:
    """Help of one of the trainer's commands."""
    return FIT if name == "fit" else OTHER.format(name=name, purpose=PURPOSES[name])
