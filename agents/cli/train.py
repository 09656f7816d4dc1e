"""`ferguson train`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse

from agents.cli.arguments import (
    GOES_ON,
    add_output_options,
    check_directory,
    check_number,
    directory,
    minutes,
    positive,
    seed,
    workers,
)
from agents.cli.completion import DIRECTORY, FIELDS, FILE, MODEL, completes
from agents.models import shipped_agents
from agents.runtime.jobs import DONE, Job
from agents.runtime.terminal import Terminal
from agents.training import run as training
from agents.training.hyperparameters import read
from agents.training.run import ALGORITHMS, CHOSEN_ON, REPORTED_ON, Run
from ferguson_gym.runtime.optional_dependencies import installing
from ferguson_gym.runtime.suggestions import did_you_mean

MOST = 100_000
"""Fields on which a model is judged."""
HELP = "train an agent"
DESCRIPTION = f"""\
Train an agent; evaluate it while it learns, keep the best model and checkpoints, and write
model.zip, model.json, curve.csv and TensorBoard's logs. Interrupted, the same command goes on.
What agents learn with: {installing("agents")}"""
EPILOG = """\
examples:
  ferguson train dagger --minutes 35 --workers 2 --out runs/dagger
  ferguson train ppo --from runs/dagger --config ppo-refining \\
      --minutes 36 --out runs/refined
  ferguson train bc --demos ferguson/guided-v0 --out runs/cloned
  ferguson train sac --config mine.yml --seed 1 --steps 100000 --out runs/sac"""


def add_to(train: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    train.add_argument(
        "algorithm",
        choices=list(ALGORITHMS),
        metavar="ALGORITHM",
        help=f"one of {', '.join(ALGORITHMS)}",
    )
    completes(
        train.add_argument(
            "--out",
            type=directory,
            required=True,
            metavar="DIR",
            help="where the model is written; the same command goes on with what lies there",
        ),
        DIRECTORY,
    )
    completes(
        train.add_argument(
            "--config",
            metavar="FILE",
            help="hyperparameters in YAML, or the name of some that are shipped, for example "
            "ppo-refining; default: the algorithm's own",
        ),
        FILE,
    )
    train.add_argument("--seed", type=seed, default=0, metavar="N", help="of all draws; default: 0")
    train.add_argument(
        "--steps", type=positive, metavar="N", help="segments flown at most; default: see --minutes"
    )
    train.add_argument(
        "--minutes",
        type=minutes,
        metavar="M",
        help="time at most; with neither limit n_timesteps of the hyperparameters",
    )
    completes(
        train.add_argument(
            "--from",
            dest="start",
            metavar="MODEL",
            help="begin with this model, shipped or trained: its network, what it sees, its "
            "weights",
        ),
        MODEL,
    )
    train.add_argument(
        "--demos",
        metavar="DATASET_ID",
        help="demonstrations: all that bc learns from; to begin with for dagger, and in the replay "
        "buffer of sac, td3, tqc",
    )
    completes(
        train.add_argument(
            "--choose-on",
            default=CHOSEN_ON,
            metavar="SPEC",
            help="fields by which the best model is chosen while training; default: %(default)s",
        ),
        FIELDS,
    )
    completes(
        train.add_argument(
            "--report-on",
            default=REPORTED_ON,
            metavar="SPEC",
            help="fields on which it is judged at the end; default: %(default)s",
        ),
        FIELDS,
    )
    train.add_argument(
        "--workers",
        type=workers,
        default=1,
        metavar="N",
        help="worker processes, where an expert is asked; default: 1",
    )
    train.add_argument(
        "--threads", type=workers, default=1, metavar="N", help="of torch; default: 1"
    )
    train.add_argument(
        "--fresh", action="store_true", help="start over: remove the training that lies in DIR"
    )
    add_output_options(train)
    train.set_defaults(prepare=prepare)


def prepare(options: argparse.Namespace) -> Job:
    """Check the input before anything is trained.

    Raises:
        ValueError: a recipe, a model to begin with, fields or demonstrations that cannot be;
            something else in the directory.
    """
    name = options.algorithm
    algorithm = ALGORITHMS[name]
    shipped_agents.require_libraries("training", "tensorboard", "yaml", *algorithm.needs)
    check_directory(options.out)
    if options.demos is not None and not algorithm.demos:
        able = ", ".join(one for one, kind in ALGORITHMS.items() if kind.demos)
        raise ValueError(f"--demos is of no use to {name}; {able} begin with demonstrations")
    start = None
    if options.start is not None:
        start = shipped_agents.find_agent(options.start)
        if start is None:
            near = did_you_mean(options.start, shipped_agents.shipped())
            raise ValueError(
                f"--from {options.start}: no such model{near}; name a shipped one or a path"
            )
        if options.out.resolve() in (start.resolve(), *start.resolve().parents):
            raise ValueError(f"--from {options.start} lies in --out {options.out}: choose another")
    check_number([options.choose_on], MOST)
    check_number([options.report_on], MOST)
    run = Run(
        algorithm=name,
        directory=options.out,
        recipe=read(options.config or name, algorithm.keys),
        seed=options.seed,
        steps=options.steps,
        minutes=options.minutes,
        start=start,
        demos=options.demos,
        chosen_on=options.choose_on,
        reported_on=options.report_on,
        workers=options.workers,
        threads=options.threads,
        fresh=options.fresh,
        terminal=Terminal(quiet=options.quiet, colour=options.colour),
    )
    if training.can_resume(run) and training.finished(run):
        return _nothing_to_do(run)
    train = algorithm.trainer().prepare(run)

    def job() -> int:
        try:
            return train()
        except KeyboardInterrupt:
            run.terminal.note(GOES_ON)
            raise

    return job


def _nothing_to_do(run: Run) -> Job:
    def job() -> int:
        run.terminal.note(f"{run.directory} holds this training, finished; --fresh starts over")
        return DONE

    return job
