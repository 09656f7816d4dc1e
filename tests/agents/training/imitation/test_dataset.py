"""The dataset of imitation: samples are the rows that were added, as the learner observes them."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

import torch

from agents.training.imitation import dataset
from agents.training.imitation.dataset import (
    COLUMNS,
    ImitationDataset,
    ImitationSample,
    labelled_row,
)
from ferguson_gym.runtime.arrays import Array
from ferguson_gym.simulation.observe import observe_one
from ferguson_gym.simulation.settings import Settings
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_field
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import State

FIELDS = {seed: get_field(f"sparse/train:{seed}") for seed in range(4)}


def rows_of(seeds: list[int], stream: np.random.Generator) -> Array:
    """A row in each of these fields, with an action that identifies it."""
    return np.array(
        [
            labelled_row(
                seed,
                State(stream.uniform(0.0, 100.0, 2), stream.normal(size=2) * 7.0, k % 40),
                stream.uniform(-1.0, 1.0, 4).astype(np.float32),
            )
            for k, seed in enumerate(seeds)
        ]
    )


def single(sample: ImitationSample) -> Iterator[ImitationSample]:
    for k in range(len(sample.actions)):
        seen = {key: value[k] for key, value in sample.observations.items()}
        parts = (sample.actions, sample.goal, sample.obstacles, sample.present)
        yield ImitationSample(seen, *(part[k] for part in parts))


@pytest.mark.parametrize(
    "arguments",
    [
        {"observation": "discs"},
        {"observation": "rays", "rays": 9},
        {"observation": "both", "nearest": 3, "focus": 4.0},
        {"observation": "rays", "way": 4, "margin": 0.5},
    ],
    ids=["discs", "rays", "both", "way"],
)
def test_samples_are_the_rows_that_were_added(arguments: dict[str, Any]) -> None:
    settings, stream = Settings(**arguments), np.random.default_rng(0)
    known = ImitationDataset(settings)
    assert len(known) == 0
    parts = [rows_of([0, 0, 2, 1, 1, 1], stream), rows_of([3, 0, 2], stream)]
    for part in [*parts, np.empty((0, COLUMNS))]:
        known.add_states(part, FIELDS.__getitem__)
    assert len(known) == 9
    by_action = {tuple(np.float32(one[6:10])): one for one in np.concatenate(parts)}
    drawn = known.sample(stream, 200, 0.0)
    found = set()
    for sample in single(drawn):
        put = by_action[tuple(sample.actions.numpy())]
        found.add(tuple(put))
        vehicle = State(put[1:3], put[3:5], int(put[5]))
        seen = observe_one(FIELDS[int(put[0])], vehicle, settings)
        assert list(sample.observations) == list(seen)
        for key, value in seen.items():
            np.testing.assert_array_equal(sample.observations[key], value)
    assert len(found) == 9
    assert all(
        value.dtype == torch.float32 for value in (*drawn.observations.values(), drawn.obstacles)
    )


def test_nearby_discs_are_in_metres_in_the_vehicle_s_frame() -> None:
    field = Field(
        name="two", obstacles=Obstacles.discs([[20.0, 30.0], [17.0, 20.0], [90, 10]], [2, 1.5, 3])
    )
    # at (20, 20), heading up the second axis: forward is y, left is -x
    vehicle = State(np.array([20.0, 20.0]), np.array([0.0, 7.0]))
    action = np.zeros(4, np.float32)
    known = ImitationDataset(Settings(observation="rays"))
    known.add_states(np.array([labelled_row(5, vehicle, action)]), {5: field}.__getitem__)
    drawn = known.sample(np.random.default_rng(0), 1, 0.0)
    assert drawn.obstacles.shape == (1, 12, 3)
    assert drawn.present[0].tolist() == [1.0, 1.0] + [0.0] * 10
    there = sorted(drawn.obstacles[0, :2].tolist())
    np.testing.assert_allclose(there, [[0.0, 3.0, 1.5], [10.0, 0.0, 2.0]], atol=1e-5)
    assert not drawn.obstacles[0, 2:].any()
    np.testing.assert_allclose(drawn.goal, [[80.0, -80.0]], atol=1e-5)


def test_rows_of_shapes_and_of_discs_are_held_together() -> None:
    angles = np.arange(20) / 3.2
    many = np.stack([20.0 + 3.0 * np.cos(angles), 30.0 + 3.0 * np.sin(angles)], axis=1)
    fields = {
        0: Field(name="disc", obstacles=Obstacles.discs([[20.0, 30.0]], [2])),
        1: Field(name="wall", obstacles=Obstacles.capsules([[[17.0, 27.0], [23.0, 27.0]]], 0.5)),
        2: Field(name="many", obstacles=Obstacles.polygons([many], 0.1)),
    }
    vehicle = State(np.array([20.0, 20.0]), np.array([0.0, 7.0]))
    known = ImitationDataset(Settings(observation="rays"))
    for k in (0, 1, 2, 1, 0):
        action = np.full(4, 0.1 * k, np.float32)
        rows = np.array([labelled_row(k, vehicle, action)] * 3)
        known.add_states(rows, fields.__getitem__)
    drawn = known.sample(np.random.default_rng(0), 60, 0.0)
    assert drawn.obstacles.shape == (60, 12, 17)
    for action, obstacles, present in zip(
        drawn.actions, drawn.obstacles, drawn.present, strict=True
    ):
        assert present.tolist() == [1.0] + [0.0] * 11
        corners, radius = obstacles[0, :-1].reshape(8, 2).numpy(), float(obstacles[0, -1])
        if action[0] < 0.05:
            np.testing.assert_allclose(corners, [[10.0, 0.0]] * 8, atol=1e-5)
            assert radius == 2.0
        elif action[0] < 0.15:
            ends = sorted(corners[:2].tolist())
            np.testing.assert_allclose(ends, [[7.0, -3.0], [7.0, 3.0]], atol=1e-5)
            np.testing.assert_array_equal(corners[2:], [corners[1]] * 6)
            assert radius == 0.5
        else:  # those corners that face the point ahead, in their order
            assert np.hypot(corners[:, 0] - 10.0, corners[:, 1]).max() < 3.0001
            assert corners[:, 0].max() < 10.5
            sides = np.diff(corners, axis=0)
            assert (sides[:-1, 0] * sides[1:, 1] - sides[:-1, 1] * sides[1:, 0] > 0.0).all()


def test_capacity_grows_and_keeps_earlier_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataset, "_FIRST", 4)
    stream = np.random.default_rng(1)
    known, rows = (
        ImitationDataset(Settings(observation="discs", nearest=2)),
        rows_of([0] * 3 + [1] * 30 + [2], stream),
    )
    for part in (rows[:3], rows[3:33], rows[33:]):
        known.add_states(part, FIELDS.__getitem__)
    assert len(known) == 34
    drawn = {tuple(action.tolist()) for action in known.sample(stream, 1000, 0.0).actions}
    assert drawn == {tuple(action) for action in rows[:, 6:10].astype(np.float32).tolist()}


def test_sampling_is_uniform_and_reproducible() -> None:
    known = ImitationDataset(Settings(observation="discs", nearest=2))
    known.add_states(rows_of([0] * 10, np.random.default_rng(2)), FIELDS.__getitem__)
    drawn = [known.sample(np.random.default_rng(3), 5000, 0.0).actions for _ in range(2)]
    assert torch.equal(drawn[0], drawn[1])
    _, counts = np.unique(drawn[0].numpy(), axis=0, return_counts=True)
    assert len(counts) == 10
    assert counts.min() > 400
    assert counts.max() < 600


def test_a_field_is_looked_up_once_for_adjacent_rows() -> None:
    asked = []

    def field_of(seed: int) -> Field:
        asked.append(seed)
        return FIELDS[seed]

    known = ImitationDataset(Settings(observation="discs", nearest=2))
    known.add_states(rows_of([2, 2, 2, 0, 0, 3], np.random.default_rng(4)), field_of)
    assert asked == [2, 0, 3]


def test_a_share_of_samples_is_near_the_latest_refused_segments(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(dataset, "RECENT", 3)
    stream = np.random.default_rng(6)
    known, rows = (
        ImitationDataset(Settings(observation="discs", nearest=2)),
        rows_of([0] * 100, stream),
    )
    rows[[1, 40, 60, 99], 10] = 1.0
    known.add_states(rows[:50], FIELDS.__getitem__)
    known.add_states(rows[50:], FIELDS.__getitem__)
    latest = {tuple(one) for one in np.float32(rows[[40, 60, 99], 6:10]).tolist()}
    for hard, least, most in ((0.0, 0, 40), (0.25, 100, 140), (1.0, 400, 400)):
        drawn = known.sample(stream, 400, hard).actions.tolist()
        assert least <= sum(tuple(action) in latest for action in drawn) <= most
    # without refused segments all rows are drawn uniformly
    easy = ImitationDataset(Settings(observation="discs", nearest=2))
    easy.add_states(rows[:1], FIELDS.__getitem__)
    assert len(easy.sample(stream, 7, 0.5).actions) == 7
