"""The results of a training: learning curve, best model so far, and final model with its card."""

from __future__ import annotations

import csv
import dataclasses
import shutil
from pathlib import Path
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm

from agents.flights import fly_batch
from agents.flights.metrics import Score, score
from agents.models import loading, torch_model
from agents.models.model import MODEL
from agents.models.model_card import CARD, ModelCard, read_card, write_card
from agents.models.torch_model import TorchModel
from agents.runtime import provenance
from agents.runtime.csv_files import write_csv
from agents.runtime.interrupts import defer_interrupt
from agents.runtime.safe_npz import reason
from agents.training.run import Run, fields_named
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.simulation import arguments_to_save

CURVE, BEST = "curve.csv", "best"
_COLUMNS = ("steps", "minutes", "success", "spl", "gap")
_PACKAGES = ("ferguson-gym", "numpy", "torch", "stable-baselines3", "sb3-contrib", "gymnasium")


def card_of(run: Run, policy: str, policy_kwargs: dict[str, Any], environment: Any) -> ModelCard:
    """The card of a run's models, without results; the network's arguments are as in YAML.

    Raises:
        ValueError: the run resumes, and the card of its best model is damaged.
    """
    return ModelCard(
        algorithm=run.algorithm,
        policy=policy,
        policy_kwargs=policy_kwargs,
        environment=_with_observation(run, environment),
        seed=run.seed,
        versions=provenance.facts(*_PACKAGES)["versions"],
        commit=provenance.commit(),
        settings=run.configuration(),
    )


def _with_observation(run: Run, environment: dict[str, Any]) -> dict[str, Any]:
    """Arguments that name the observation: a run that resumes keeps the default it began with."""
    known = run.directory / BEST / CARD
    if "observation" in environment or run.fresh or not known.is_file():
        return arguments_to_save(environment)
    return {"observation": read_card(known).environment["observation"], **environment}


class TrainingRecord:
    """The learning curve and the best model of a run, kept in its directory."""

    def __init__(self, run: Run, card: ModelCard, steps: int = 0) -> None:
        """Read what the directory holds, without evaluations after `steps` (the checkpoint).

        Raises:
            ValueError: a file in the directory is damaged.
        """
        self._run, self._card = run, card
        self._best = run.directory / BEST
        self.curve = [row for row in _read_curve(run.directory / CURVE) if row["steps"] <= steps]
        self.best: float | None = None
        """The highest SPL of any model so far."""
        if (self._best / CARD).is_file():
            known = read_card(self._best / CARD)
            try:
                self.best = float(known.results["chosen_on"]["spl"])
            except (KeyError, TypeError, ValueError):
                raise ValueError(f"{self._best / CARD} holds no SPL; --fresh starts over") from None

    def evaluate(self, model: BaseAlgorithm, steps: int, seconds: float) -> Score:
        """Evaluate a model on the validation fields, and keep it if it is the best so far.

        Args:
            model: as it is now.
            steps: segments flown so far, or another counter of progress.
            seconds: time of training so far [s].
        """
        network = TorchModel(model.policy, self._card).model
        found = score(fly_batch(network, fields_named(self._run.chosen_on)))
        measures = (steps, round(seconds / 60.0, 3), found.success, found.spl, found.gap)
        self.curve.append(row := dict(zip(_COLUMNS, measures, strict=True)))
        if self.best is None or found.spl >= self.best:
            results = {"chosen_on": _format_results(self._run.chosen_on, found)}
            self._best.mkdir(parents=True, exist_ok=True)
            card = dataclasses.replace(self._card, curve=self.curve, results=results)
            torch_model.save(self._best, model, card)
            self.best = found.spl
        write_csv(self._run.directory / CURVE, _COLUMNS, _cells(self.curve))
        self._run.terminal.note(format_row(row))
        return found

    def finish(self) -> ModelCard:
        """Evaluate the best model on the fields of the report, and make it the final model."""
        best = loading.load(self._best)
        with defer_interrupt(), self._run.terminal.share_bar() as bar:
            bar.add_task("evaluating the best model", total=None)
            found = score(fly_batch(best, fields_named(self._run.reported_on)))
        reported = {"reported_on": _format_results(self._run.reported_on, found)}
        results = {**best.card.results, **reported}
        card = dataclasses.replace(best.card, curve=self.curve, results=results)
        directory = self._run.directory
        with atomic_write(directory / MODEL) as temporary:
            shutil.copyfile(self._best / MODEL, temporary)
        write_card(directory, card)
        gap = "no gap" if found.gap is None else f"median gap {found.gap:.2%}"
        terminal = self._run.terminal
        terminal.show(
            f"{self._run.reported_on}: success {found.success:.2%} ({found.success_low:.2%} to "
            f"{found.success_high:.2%}), SPL {found.spl:.4f}, {gap}"
        )
        terminal.note(f"wrote model.zip, model.json and {CURVE} to {directory}")
        return card


def format_row(row: dict[str, Any]) -> str:
    """A row of the learning curve as a line of text."""
    gap = "" if row["gap"] is None else f"   gap {row['gap']:6.2%}"
    return (
        f"{row['steps']:>12,} steps {row['minutes']:7.1f} min   "
        f"SPL {row['spl']:.4f}   success {row['success']:6.1%}{gap}"
    )


def _format_results(fields: str, found: Score) -> dict[str, Any]:
    return {"fields": fields, **dataclasses.asdict(found)}


def _cells(curve: list[dict[str, Any]]) -> list[list[object]]:
    return [["" if row.get(key) is None else repr(row[key]) for key in _COLUMNS] for row in curve]


def _read_curve(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        return []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [
                {key: None if text == "" else float(text) for key, text in row.items()}
                | {"steps": int(row["steps"])}
                for row in csv.DictReader(file, strict=True)
            ]
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is damaged ({reason(error)}); --fresh starts over") from None
