"""`ferguson bench solvers`: what it writes, prints and refuses."""

import csv
from pathlib import Path

import numpy as np
import pytest

from agents.benchmarks.solvers import Solved, excess, take_windows
from agents.cli.main import main
from ferguson_gym.world.field import Field
from ferguson_gym.world.field_names import get_fields
from ferguson_gym.world.limits import PAPER_LIMITS
from ferguson_gym.world.obstacles import Obstacles
from ferguson_gym.world.transition import initial_state
from planners.optimization.initial_guesses import straight_ahead
from planners.optimization.reference.exchange import ByExchange
from planners.optimization.reference.ipopt import Ipopt
from planners.optimization.reference.slsqp import Slsqp
from planners.optimization.window import WindowSettings, final_window
from planners.receding_horizon.paper import RecedingHorizon

BENCH = ["bench", "solvers", "--ipopt-every", "0", "--fields", "sparse/train:0-1"]


def test_every_solver_has_a_row_for_every_window(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    out = tmp_path / "deep" / "results"
    assert main([*BENCH, "--windows", "2", "--out", str(out)]) == 0
    with (out / "steps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    windows = ["sparse/train:0 step 0", "sparse/train:0 step 1"]
    assert [(row["solver"], row["window"]) for row in rows] == [
        (solver, window) for window in windows for solver in ("ours", "slsqp")
    ]
    for row in rows:
        assert 0 < int(row["feasible"]) <= int(row["starts"]) <= 11
        assert 0.0 < float(row["objective"]) < 200.0
        assert float(row["seconds"]) > 0.0
    assert (out / "solvers.png").read_bytes().startswith(b"\x89PNG")
    printed = capsys.readouterr().out
    assert "Solvers on the same windows from the same starts" in printed
    assert "ours against slsqp: objective no worse in" in printed


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([*BENCH[:-1], "nowhere"], "unknown field 'nowhere'"),
        ([*BENCH[:-1], "sparse/train:3-1"], "empty range"),
        ([*BENCH, "--windows", "0"], "an integer >= 1"),
        ([*BENCH, "--ipopt-every", "-1"], "--ipopt-every"),
        (["bench", "kites"], "invalid choice: 'kites'"),
    ],
)
def test_bad_arguments_are_one_line_and_status_two(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    target = tmp_path / "results"
    if arguments[:2] == ["bench", "solvers"]:
        arguments = [*arguments, "--out", str(target)]
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert message in err
    assert not target.exists()


def test_windows_are_those_of_the_flights_in_order() -> None:
    planner = RecedingHorizon(random_starts=2)
    tasks = take_windows(planner, get_fields("sparse/train:0-1"), 9)
    fields = [task.window.field.name for task in tasks]
    assert fields == sorted(fields)
    assert len({task.name for task in tasks}) == 9
    steps = [int(task.name.rpartition(" ")[2]) for task in tasks if fields[0] in task.name]
    assert steps == list(range(len(steps)))
    for task in tasks:
        assert len(task.guesses) <= 3
        for guess in task.guesses:
            np.testing.assert_array_equal(guess[0, (0, 2)], task.window.chain.knots[0])


def test_too_few_windows_are_an_error() -> None:
    with pytest.raises(ValueError, match=r"these fields have \d+ windows, 500 are asked"):
        take_windows(RecedingHorizon(random_starts=0), get_fields("sparse/train:0"), 500)


def test_an_excess_is_relative_to_the_best_of_all_or_to_the_gate() -> None:
    def solved(solver: str, window: str, objective: float) -> Solved:
        return Solved(solver, window, 1, 1, objective, 1.0, [1.0])

    results = [
        *(solved("ours", w, f) for w, f in zip("abcd", (10.0, 22.0, np.inf, 0.0), strict=True)),
        *(solved("slsqp", w, f) for w, f in zip("abcd", (11.0, 20.0, np.inf, 0.5), strict=True)),
    ]
    above = excess(results, 1.0)
    np.testing.assert_allclose(above["ours"], [0.0, 0.1, 0.0, 0.0])
    np.testing.assert_allclose(above["slsqp"], [0.1, 0.0, 0.0, 0.5])
    lost = excess([solved("ours", "a", 1.0), solved("slsqp", "a", np.inf)], 1.0)
    assert lost["slsqp"][0] == np.inf


def test_ipopt_and_slsqp_reach_the_same_minimum() -> None:
    pytest.importorskip("casadi")
    discs = Obstacles.discs([[9.0, 7.0]], [2.0])
    field = Field(name="easy", obstacles=discs, goal=np.array([20.0, 20.0]))
    window = final_window(field, initial_state(field), WindowSettings(), 3)
    guess = straight_ahead(initial_state(field), 3, PAPER_LIMITS)
    ends = [ByExchange(solver).solve(window, [guess])[0] for solver in (Ipopt(), Slsqp())]
    assert all(end.feasible for end in ends)
    ipopt, slsqp = (end.solution.objective for end in ends)
    assert slsqp > field.distance + 0.02
    assert ipopt == pytest.approx(slsqp, rel=1e-4)
