"""`ferguson train`: what it is asked, and the input checked."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from agents import shelf, training
from agents.arguments import DONE, Job, check_directory, positive, seed
from agents.training import ALGORITHMS, CHOSEN_ON, REPORTED_ON, Run
from agents.training_recipe import read


def add_to(train: argparse.ArgumentParser) -> None:
    """Give the command its arguments."""
    train.add_argument("algorithm", metavar="ALGORITHM", help=f"one of {', '.join(ALGORITHMS)}")
    train.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="where the model is written; the same command goes on with what lies there",
    )
    train.add_argument(
        "--config",
        metavar="FILE",
        help="hyperparameters in YAML, or the name of some that are shipped, for example "
        "ppo-refining; default: the algorithm's own",
    )
    train.add_argument("--seed", type=seed, default=0, metavar="N", help="default: 0")
    train.add_argument(
        "--steps", type=positive, metavar="N", help="segments flown at most; default: see --minutes"
    )
    train.add_argument(
        "--minutes",
        type=_minutes,
        metavar="M",
        help="time at most; with neither limit n_timesteps of the hyperparameters",
    )
    train.add_argument(
        "--from",
        dest="start",
        metavar="MODEL",
        help="begin with this model, shipped or trained: its network, what it sees, its weights",
    )
    train.add_argument(
        "--demos",
        metavar="DATASET_ID",
        help="demonstrations: all that bc learns from; to begin with for dagger, and in the replay "
        "buffer of sac, td3, tqc",
    )
    train.add_argument(
        "--choose-on",
        default=CHOSEN_ON,
        metavar="SPEC",
        help="fields by which the best model is chosen while training; default: %(default)s",
    )
    train.add_argument(
        "--report-on",
        default=REPORTED_ON,
        metavar="SPEC",
        help="fields on which it is judged at the end; default: %(default)s",
    )
    train.add_argument(
        "--workers",
        type=positive,
        default=1,
        metavar="N",
        help="worker processes, where an expert is asked; default: 1",
    )
    train.add_argument(
        "--threads", type=positive, default=1, metavar="N", help="of torch; default: 1"
    )
    train.add_argument(
        "--fresh", action="store_true", help="start over: remove the training that lies in DIR"
    )
    train.set_defaults(prepare=_prepare)


def _minutes(text: str) -> float:
    try:
        minutes = float(text)
    except ValueError:
        minutes = math.nan
    if not 0.0 < minutes < math.inf:
        raise argparse.ArgumentTypeError(f"need minutes, a number above 0, got {text!r}")
    return minutes


def _prepare(options: argparse.Namespace) -> Job:
    name = options.algorithm
    if name not in ALGORITHMS:
        raise ValueError(f"unknown algorithm {name!r}; algorithms are {', '.join(ALGORITHMS)}")
    algorithm = ALGORITHMS[name]
    shelf.need("training", "tensorboard", "yaml", *algorithm.needs)
    check_directory(options.out)
    if options.demos is not None and not algorithm.demos:
        able = ", ".join(one for one, kind in ALGORITHMS.items() if kind.demos)
        raise ValueError(f"--demos is of no use to {name}; {able} begin with demonstrations")
    start = None
    if options.start is not None:
        start = shelf.find(options.start)
        if start is None:
            raise ValueError(f"--from {options.start}: no such model; name a shipped one or a path")
        if options.out.resolve() in (start.resolve(), *start.resolve().parents):
            raise ValueError(f"--from {options.start} lies in --out {options.out}: choose another")
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
    )
    if training.left_off(run) and training.finished(run):
        return _nothing_to_do(run)
    return algorithm.trainer().prepare(run)


def _nothing_to_do(run: Run) -> Job:
    from agents.tables import console

    def job() -> int:
        console().print(
            f"{run.directory} holds this training, finished; --fresh starts over",
            markup=False,
            soft_wrap=True,
        )
        return DONE

    return job
