"""`ferguson train`: its arguments and checks."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from agents.cli import shared_options as shared
from agents.cli.arguments import Parser, check_directory, check_number, minutes, positive, workers
from agents.cli.completion import FIELDS, FILE, MODEL
from agents.models import shipped_agents
from agents.runtime.jobs import Job
from agents.runtime.terminal import Terminal
from agents.training import run as training
from agents.training.hyperparameters import read
from agents.training.run import ALGORITHMS, CHOSEN_ON, REPORTED_ON, Run
from ferguson_gym.runtime import did_you_mean
from ferguson_gym.runtime.optional_dependencies import installing

MOST = 100_000
"""Upper limit of the fields on which a model is evaluated."""
HELP = "train an agent by reinforcement or imitation learning"
DESCRIPTION = f"""\
Train an agent and evaluate it while it learns; keep the best model and checkpoints, and write
model.zip, model.json, curve.csv and logs for TensorBoard. After an interruption the same command
resumes. To install the libraries: {installing("agents")}"""
EPILOG = """\
examples:
  ferguson train dagger --config dagger-way --minutes 28 --workers 2 \\
      --out runs/dagger-way
  ferguson train ppo --from runs/dagger --config ppo-refining \\
      --minutes 36 --out runs/refined
  ferguson train ppo --fields forest/train:0-9999 --out runs/forest
  ferguson train bc --demos ferguson/guided-v0 --out runs/cloned
  ferguson train tqc --config mine.yml --seed 1 --steps 100000 --out runs/tqc"""


def add_to(train: Parser) -> None:
    """Add the arguments."""
    train.add_argument(
        "algorithm", choices=list(ALGORITHMS), metavar="ALGORITHM", help=", ".join(ALGORITHMS)
    )
    shared.add_out(train, "output directory; an interrupted training in it is resumed")
    train.add_argument(
        "--config",
        metavar="FILE",
        help="YAML file of hyperparameters, or the name of a built-in configuration, for example "
        "ppo-refining; default: that of the algorithm",
        complete=FILE,
    )
    shared.add_seed(train, "seed of all random numbers")
    train.add_argument(
        "--steps",
        type=positive,
        metavar="N",
        help="limit of training, in segments flown (bc: training samples, dagger: states "
        "visited in rollouts)",
    )
    train.add_argument(
        "--minutes",
        type=minutes,
        metavar="M",
        help="limit of training time; without --steps and --minutes, n_timesteps of the "
        "configuration limits the steps",
    )
    train.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help="start from this model (name of an agent or directory) with its network, observation "
        "and weights",
        complete=MODEL,
    )
    train.add_argument(
        "--demos",
        metavar="DATASET_ID",
        help="dataset of demonstrations: the training data of bc, the first data of dagger, the "
        "initial replay buffer of tqc",
    )
    shared.add_fields(
        train,
        "fields to train on, instead of those of the configuration: names, JSON files or "
        "directories of them, from which flights draw",
        required=False,
    )
    for option, default, what in (
        ("--choose-on", None, f"best model is selected; default: {CHOSEN_ON}"),
        ("--report-on", REPORTED_ON, f"selected model is evaluated; default: {REPORTED_ON}"),
    ):
        text = f"fields, separated by commas, on which the {what}"
        train.add_argument(option, default=default, metavar="SPEC", help=text, complete=FIELDS)
    shared.add_workers(train, "number of worker processes, used by dagger")
    train.add_argument(
        "--threads",
        type=workers,
        default=1,
        metavar="N",
        help="threads of torch and of the environment; default: 1",
    )
    train.add_argument(
        "--fresh", action="store_true", help="start over: delete the earlier training in DIR"
    )
    shared.add_output_options(train)
    train.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace, terminal: Terminal) -> Job:
    """Check the input before training.

    Raises:
        ValueError: the hyperparameters, initial model, fields or demonstrations are not valid, or
            the directory holds something else.
    """
    name = options.algorithm
    algorithm = ALGORITHMS[name]
    shipped_agents.require_libraries("training", "tensorboard", "yaml")
    check_directory(options.out)
    if options.demos is not None and not algorithm.demos:
        able = ", ".join(one for one, kind in ALGORITHMS.items() if kind.demos)
        raise ValueError(f"{name} cannot use --demos; {able} can")
    start = None if options.start is None else _initial_model(options)
    hyperparameters = read(options.config or name, algorithm.keys)
    chosen_on = options.choose_on or ",".join(hyperparameters.choose_on) or CHOSEN_ON
    for spec in (chosen_on, options.report_on):
        check_number(spec.split(","), MOST)
    run = Run(
        algorithm=name,
        directory=options.out,
        hyperparameters=hyperparameters,
        seed=options.seed,
        steps=options.steps,
        minutes=options.minutes,
        start=start,
        demos=options.demos,
        fields=tuple(options.fields or hyperparameters.fields),
        chosen_on=chosen_on,
        reported_on=options.report_on,
        workers=options.workers,
        threads=options.threads,
        fresh=options.fresh,
        terminal=terminal,
    )
    if training.can_resume(run) and training.finished(run):
        text = f"the training in {run.directory} is already finished; --fresh starts over"
        return partial(terminal.note, text)
    return algorithm.trainer().prepare(run)


def _initial_model(options: argparse.Namespace) -> Path:
    """Directory of the model to begin with."""
    start = shipped_agents.find_agent(options.start)
    if start is None:
        near = did_you_mean(options.start, shipped_agents.shipped())
        raise ValueError(
            f"--from {options.start}: no such model{near}; give the name of a shipped agent or "
            "the directory of a trained one"
        )
    if options.out.resolve() in (start.resolve(), *start.resolve().parents):
        raise ValueError(
            f"--from {options.start} is inside --out {options.out}; choose another output directory"
        )
    return start
