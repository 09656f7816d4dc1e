"""What a training leaves behind: its curve, the best model so far, the final one with its card."""

from __future__ import annotations

import csv
import dataclasses
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm

from agents.flights.batched import fly_batch
from agents.flights.metrics import Score, score
from agents.models import loading, torch_model
from agents.models.model import MODEL
from agents.models.model_card import CARD, ModelCard, read_card, write_card
from agents.models.torch_model import TorchModel
from agents.runtime import provenance
from agents.runtime.csv_files import write_csv
from agents.runtime.interrupts import defer_interrupt
from agents.training.run import Run
from ferguson_gym.runtime.atomic_files import atomic_write
from ferguson_gym.world.field_names import get_fields

CURVE = "curve.csv"
_COLUMNS = ("steps", "minutes", "success", "spl", "gap")
_PACKAGES = ("ferguson-gym", "numpy", "torch", "stable-baselines3", "sb3-contrib", "gymnasium")


def card_of(run: Run, policy: str, policy_kwargs: dict[str, Any], environment: Any) -> ModelCard:
    """The card of a run's models, before anything is known of them.

    Args:
        run: whose.
        policy: name of the network.
        policy_kwargs: as YAML has them.
        environment: arguments of the environment.
    """
    return ModelCard(
        algorithm=run.algorithm,
        policy=policy,
        policy_kwargs=policy_kwargs,
        environment=dict(environment),
        seed=run.seed,
        versions=provenance.facts(*_PACKAGES)["versions"],
        commit=provenance.commit(),
        settings=run.configuration(),
    )


class Record:
    """Of one run; it goes on with what its directory holds."""

    def __init__(self, run: Run, card: ModelCard, steps: int = 0) -> None:
        """A run that goes on after so many steps forgets what came after them.

        Raises:
            ValueError: what the directory holds is damaged.
        """
        self._run, self._card = run, card
        self._best = run.directory / "best"
        self.curve = [row for row in _read_curve(run.directory / CURVE) if row["steps"] <= steps]
        self.best: float | None = None
        """The highest SPL of any model so far."""
        if (self._best / CARD).is_file():
            known = read_card(self._best / CARD)
            try:
                self.best = float(known.results["chosen_on"]["spl"])
            except (KeyError, TypeError, ValueError):
                raise ValueError(
                    f"{self._best / CARD} does not say what it reaches; --fresh starts over"
                ) from None

    def consider(
        self, model: BaseAlgorithm, steps: int, seconds: float, also: dict[str, float] | None = None
    ) -> Score:
        """Fly a model through the fields by which the best is chosen, and keep it if it is.

        Args:
            model: as it is now.
            steps: segments flown so far, or any other count that grows.
            seconds: since the training began, breaks left out.
            also: what else belongs into the curve.
        """
        found = score(
            fly_batch(TorchModel(model.policy, self._card).model, get_fields(self._run.chosen_on))
        )
        row = {
            "steps": steps,
            "minutes": round(seconds / 60.0, 3),
            "success": found.success,
            "spl": found.spl,
            "gap": found.gap,
            **(also or {}),
        }
        self.curve.append(row)
        if self.best is None or found.spl >= self.best:
            results = {"chosen_on": _told(self._run.chosen_on, found)}
            self._best.mkdir(parents=True, exist_ok=True)
            card = dataclasses.replace(self._card, curve=self.curve, results=results)
            torch_model.save(self._best, model, card)
            self.best = found.spl
        columns = list(dict.fromkeys([*_COLUMNS, *(key for row in self.curve for key in row)]))
        write_csv(self._run.directory / CURVE, columns, _cells(self.curve, columns))
        self._run.terminal.note(line(row))
        return found

    def finish(self) -> ModelCard:
        """Fly the best model through the fields that are reported, and make it the final one."""
        best = loading.load(self._best)
        with defer_interrupt():
            found = score(fly_batch(best, get_fields(self._run.reported_on)))
        results = {**best.card.results, "reported_on": _told(self._run.reported_on, found)}
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


def line(row: dict[str, Any]) -> str:
    """A row of the curve for people."""
    gap = "" if row["gap"] is None else f"   gap {row['gap']:6.2%}"
    return (
        f"{row['steps']:>12,} steps {row['minutes']:7.1f} min   "
        f"SPL {row['spl']:.4f}   success {row['success']:6.1%}{gap}"
    )


def _told(fields: str, found: Score) -> dict[str, Any]:
    return {"fields": fields, **dataclasses.asdict(found)}


def _cells(curve: Sequence[dict[str, Any]], columns: Sequence[str]) -> list[list[object]]:
    return [["" if row.get(key) is None else repr(row[key]) for key in columns] for row in curve]


def _read_curve(path: Path) -> list[dict[str, Any]]:
    if not path.is_file():
        return []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return [_row(row) for row in csv.DictReader(file, strict=True)]
    except (csv.Error, KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise ValueError(f"{path} is damaged ({reason}); --fresh starts over") from None


def _row(cells: dict[str, str]) -> dict[str, Any]:
    """Of a table that has a column of steps."""
    steps = int(cells["steps"])
    rest = {key: None if text == "" else float(text) for key, text in cells.items()}
    return rest | {"steps": steps}
