"""Terminal output: results on standard output, notes and bars on standard error."""

import argparse
import io
import json
import logging
import re
import resource
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from rich.console import Console

from agents.cli import compile_notice
from agents.cli.main import _parser, main
from agents.evaluation.statistics import summarise
from agents.evaluation.tables import of_summary
from agents.runtime import terminal, worker_processes
from agents.runtime.terminal import Terminal
from ferguson_gym.runtime import cache_directory, compilation
from tests.support.written_results import write_results

PROGRAM = [sys.executable, "-m", "agents.cli.main"]
PLAN = ["plan", "paper:1", "--planner", "guided"]


def commands(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser and all below it."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                yield from commands(below)


COMMANDS = {command.prog: command for command in commands(_parser())}


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_and_its_examples_parse(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = COMMANDS[name].format_help()
    assert max(map(len, text.splitlines())) <= 80
    _, _, examples = text.partition("\nexamples:\n")
    lines = [
        line.strip()
        for line in examples.partition("\n\n")[0].replace("\\\n", " ").splitlines()
        if line.strip()
    ]
    assert lines
    for line in lines:
        program, *arguments = shlex.split(line)
        assert program == "ferguson"
        if "--help" in arguments:
            assert main(arguments) == 0
        else:
            _parser().parse_args(arguments)


@pytest.mark.parametrize("group", [[], ["bench"]])
def test_a_group_without_a_command_shows_its_help(
    group: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(group) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(" ".join(["usage: ferguson", *group]))
    assert "examples:" in err


class Screen(io.StringIO):
    """A stream that claims to be a terminal."""

    def isatty(self) -> bool:
        return True


def drawn(terminal: Terminal) -> str:
    with terminal.bar() as bar:
        bar.advance(bar.add_task("flights", total=2))
        bar.refresh()
        terminal.note("so far")
    assert isinstance(sys.stderr, io.StringIO)
    return sys.stderr.getvalue()


COLOURS = re.compile(r"\x1b\[[0-9;]*(?:3[0-8]|4[0-8])[0-9;]*m")


def test_bars_are_for_terminals_and_colours_turn_off(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE", "TTY_INTERACTIVE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")

    def screen(kind: type[io.StringIO] = Screen) -> None:
        monkeypatch.setattr(sys, "stderr", kind())

    screen()
    output = drawn(Terminal())
    assert "flights" in output
    assert COLOURS.search(output)
    screen()
    output = drawn(Terminal(colour=False))
    assert "flights" in output
    assert not COLOURS.search(output)
    screen()
    assert drawn(Terminal(quiet=True)) == ""
    screen(io.StringIO)
    assert drawn(Terminal()) == "so far\n"
    screen()
    with monkeypatch.context() as patch:
        patch.setenv("NO_COLOR", "1")
        output = drawn(Terminal())
    assert "flights" in output
    assert not COLOURS.search(output)
    screen()
    monkeypatch.setenv("TERM", "dumb")
    assert drawn(Terminal()) == "so far\n"


def test_a_waiting_bar_shows_the_compilation_hint(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setattr(terminal, "_HINT_AFTER", 0.0)
    monkeypatch.setattr(sys, "stderr", Screen())
    with Terminal().bar() as bar:
        flights = bar.add_task("flights", total=2)
        (hint,) = [
            column for column in bar.columns if isinstance(column, terminal._CompilationHint)
        ]
        assert terminal.HINT in hint.render(bar.tasks[flights]).plain
        bar.advance(flights)
        assert hint.render(bar.tasks[flights]).plain == ""


@pytest.mark.parametrize("quiet", [False, True])
def test_commands_print_what_the_package_reports_of_its_compilation(
    quiet: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    warned: list[str] = []
    with compile_notice.announce_compilation(Terminal(quiet=quiet), warned.append):
        logging.getLogger(compilation.__name__).warning(compilation.COMPILING)
        logging.getLogger(cache_directory.__name__).warning("not cached")
    assert sys.stderr.getvalue() == ("" if quiet else f"{compilation.COMPILING}\n")
    assert warned == ["not cached"]
    assert caplog.record_tuples == []
    logging.getLogger(compilation.__name__).warning("afterwards")
    assert caplog.messages == ["afterwards"]


def test_workers_do_not_announce_what_the_first_process_does() -> None:
    with worker_processes.map_in_processes([(logger_level, (), {})] * 2, 2) as levels:
        assert list(levels) == [logging.ERROR] * 2
    assert logger_level() == logging.NOTSET


def logger_level() -> int:
    return logging.getLogger(compilation.PACKAGE).level


def test_kernels_are_compiled_ahead(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compile", "--policy", "shortest", "-q"]) == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(r"kernels are ready after \d+\.\d s\n", out)
    assert err == ""
    assert main(["compile", "--policy", "shortets"]) == 2
    assert "shortest" in capsys.readouterr().err


def test_quiet_leaves_results_and_json_is_all_there_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["evaluate", "--policy", "guided", "--fields", "sparse/train:0-1"]
    command += ["--out", str(tmp_path / "results")]
    assert main([*command, "--json"]) == 0
    out, err = capsys.readouterr()
    report = json.loads(out)
    assert report == json.loads((tmp_path / "results" / "summary.json").read_text())
    assert report["statistics"]["policies"][0]["success"] == 1.0
    assert err.startswith("wrote flights.csv, ")
    # what is there is shown again
    assert main([*command, "--json", "--quiet"]) == 0
    again, err = capsys.readouterr()
    assert again == out
    assert err == ""
    assert main([*command, "-q"]) == 0
    out, err = capsys.readouterr()
    assert "100.0 (34.2" in out
    assert err == ""


def test_a_comparison_of_planners_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "results"
    command = ["bench", "planners", "--fields", "sparse/train:0", "--planner", "shortest"]
    assert main([*command, "--out", str(out), "--json", "-q"]) == 0
    told, err = capsys.readouterr()
    assert json.loads(told) == json.loads((out / "summary.json").read_text())
    assert err == ""


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    with subprocess.Popen(
        [*PROGRAM, *PLAN], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        running.stdout.close()
        assert running.stderr.read() == b""
    assert running.returncode == 0


def test_output_without_room_is_one_line() -> None:
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*PROGRAM, *PLAN, "--json"], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert (done.returncode, done.stderr) == (2, "ferguson: No space left on device\n")


def test_a_full_disk_is_reported_in_one_line_and_work_resumes(tmp_path: Path) -> None:
    def little_room() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))

    out = tmp_path / "results"
    command = ["evaluate", "--policy", "shortest", "--fields", "sparse/train:0-3"]
    command += ["--out", str(out), "--quiet"]
    done = subprocess.run(
        [*PROGRAM, *command], preexec_fn=little_room, capture_output=True, text=True
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "File too large" in done.stderr
    assert [path.name for path in out.iterdir()] == [".unfinished"]
    assert main(command) == 0
    assert (out / "report.html").exists()
    assert not (out / ".unfinished").exists()


@pytest.mark.parametrize("width", [80, 120])
def test_tables_of_an_evaluation_fit_and_show_failures(width: int, tmp_path: Path) -> None:
    name = "multi-start+backtrack+margin=0.5+sensing=20"
    lengths = {
        "[red]late": {f"f{k}": [None if k % 2 else 160.0] for k in range(40)},
        name: {f"f{k}": [141.0 + k] for k in range(40)},
    }
    found = summarise(write_results(tmp_path / "results", lengths))
    policies = [
        {"policy": policy, "stopped_by_clock": policy == name} for policy in ("[red]late", name)
    ]
    console = Console(width=width, file=io.StringIO(), record=True)
    for table in of_summary({"statistics": found, "policies": policies}):
        console.print(table, markup=False)
    text = console.export_text()
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= width
    for cell in ("50.0", "(35.2", "0.438", "100.0", "(91.2", " 20 : 0 ", "< 0.0001", " inf "):
        assert cell in text, cell
    flat = " ".join(text.split())
    assert (width < 120) != ("50.0 (35.2" in text)  # an interval continues in a second line
    # two tables have a group for each kind of knowledge; nothing says what an unknown policy knows
    headings = [line.strip() for line in text.splitlines() if re.fullmatch(r"[a-z ?]+: *", line)]
    assert headings == ["nearby:", "?:", "?:"]
    assert f"{name} (nearby) compared with the others" in flat
    assert "whole field: knows all obstacles from the start; nearby: sees obstacles" in flat
    assert "[red]late failed 20 of 40: 20 x cut into an obstacle" in flat
    assert f"{name} has a time limit, so its flights are not exactly" in flat
