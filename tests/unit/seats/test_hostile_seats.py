"""Programs that break rules: the game goes on, the report names them, and no process is left."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from robochoc.seats import GameOptions, GameReport, Limits, play
from robochoc.seats.line_process import LINE_BYTES, ROUND_BYTES
from robochoc.seats.report import MOST_LISTED
from robochoc.solver.errors import UnsupportedError
from tests.support.limits import HANG_S, wait_until
from tests.support.seats import lamps, program

PATIENT = Limits(timeout_s=HANG_S, messages=2, characters_each=100, characters=150)
QUICK = Limits(timeout_s=0.2)


def game(command: list[str], limits: Limits = PATIENT, rounds: int = 2) -> GameReport:
    return play(lamps(), GameOptions({"r1": command}, others="greedy", rounds=rounds, limits=limits))


def rules(report: GameReport) -> dict[str, int]:
    assert [one.breaches for one in report.seats if one.robot != "r1"] == [()] * 3
    return dict(report["r1"].broken_rules)


@pytest.mark.parametrize(
    ("body", "rule"),
    [
        ("move = 'not a move'", "garbage"),
        ("move['extra'] = 1", "garbage"),
        ("move['round'] = number + 1", "garbage"),
        ("move['tokens'] = 'many'", "garbage"),
        ("move = eval('[' * 90 + ']' * 90)", "garbage"),
        ("print('\\x1b[2J\\xff' * 9, flush=True); continue", "garbage"),
        ("move['say'] = [{'to': neighbours[0]}]", "garbage"),
        ("move['say'] = [{'to': neighbours[0], 'claim': {'value': values[0], 'cost': -1}}]", "garbage"),
        ("move['value'] = {'r1.c': 7}", "invalid-value"),
        ("move['value'] = {'r1.c': 0, 'other': 1}", "invalid-value"),
        ("move['announce'] = {'r1.c': 9}", "invalid-value"),
        ("move['say'] = [{'to': 'r3', 'text': 'hello'}]", "wrong-receiver"),
        ("move['say'] = [{'to': neighbours[0], 'text': 'x' * 101}]", "oversized"),
        ("move['say'] = [{'to': neighbours[0], 'text': 'x'}] * 3", "too-many"),
    ],
)
def test_a_broken_rule_is_named_in_each_round(body: str, rule: str) -> None:
    report = game(program(body))
    assert rules(report) == {rule: 2}
    assert all(char.isprintable() for one in report["r1"].breaches for char in one.details)


def test_a_deep_line_is_garbage() -> None:
    assert rules(game(program("print('[' * 60000, flush=True); continue"))) == {"garbage": 2}


def test_a_line_that_is_too_long_is_dropped() -> None:
    report = game(program(f"print('x' * {LINE_BYTES + 1}, flush=True)"))
    assert rules(report) == {"oversized": 2}
    assert report["r1"].messages == 4


def test_the_budget_of_characters() -> None:
    report = game(program("move['say'] = [{'to': neighbours[0], 'text': 'x' * 100}]"), rounds=3)
    assert rules(report) == {"too-many": 2}
    assert (report["r1"].texts, report["r1"].characters) == (1, 100)


def test_the_report_of_a_long_game_is_short_and_counts_everything() -> None:
    body = """
move['say'] = [{'to': neighbours[0], 'claim': {'value': values[0], 'cost': 1000 + number}}] * 2
if number > 55: move['value'] = {}
"""
    seat = game(program(body), Limits(timeout_s=HANG_S, messages=1), rounds=120)["r1"]
    assert dict(seat.broken_rules) == {"too-many": 120, "invalid-value": 65}
    assert len(seat.breaches) == MOST_LISTED
    assert (len(seat.false_claims), seat.false_claims_total) == (MOST_LISTED, 120)
    last = game(program("if number < 150: move['round'] = 0.5\nelse: move['value'] = {}"), rounds=150)["r1"]
    assert (last.breaches[-1].round, str(last.breaches[-1].rule)) == (150, "invalid-value")
    assert len(last.breaches) == MOST_LISTED + 1


@pytest.mark.parametrize("rounds", [1, 3])
def test_a_flooding_program_is_ended(rounds: int) -> None:
    flood = f"\nwhile True: os.write(1, b'x' * {ROUND_BYTES})"
    assert rules(game(program(flood, sends=False), rounds=rounds)) == {"flooding": 1}


def test_many_lines_are_flooding() -> None:
    report = game(program("\nwhile True: print('{}'[:0] + '   ', flush=True)", sends=False))
    assert rules(report) == {"flooding": 1}


def test_a_program_that_ends() -> None:
    assert rules(game([sys.executable, "-c", ""])) == {"ended": 1}
    assert rules(game(program("if number == 2: sys.exit(1)"), rounds=4)) == {"ended": 1}


@pytest.mark.parametrize(
    "body",
    [
        "time.sleep(1000)",
        "os.kill(os.getpid(), signal.SIGSTOP)",
        "signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(1000)",
    ],
)
def test_a_silent_or_stopped_program_is_late(body: str) -> None:
    report = game(program(body), QUICK)
    assert rules(report) == {"late": 2}
    assert report["r1"].messages == 4  # it keeps its value, which is announced for it


def test_a_program_that_never_reads() -> None:
    assert rules(game([sys.executable, "-c", "import time; time.sleep(1000)"], QUICK)) == {"late": 2}


def test_no_process_is_left(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    body = f"""
if number == 1:
    child = os.fork()
    if not child: time.sleep(1000)
    open({str(pids)!r}, "w").write(f"{{os.getpid()}} {{child}}")
"""
    game(program(body))
    for pid in map(int, pids.read_text().split()):
        wait_until(partial(_has_ended, pid), f"process {pid} still runs")


def _has_ended(pid: int) -> bool:
    """Return whether a process has ended; one that nobody waits for also counts."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return True
    return state in "ZX"


def test_programs_end_if_the_game_fails(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    command = [sys.executable, "-c", f"import os; open({str(pid)!r}, 'w').write(str(os.getpid())); input(); input()"]
    with pytest.raises(UnsupportedError, match="cannot be started"):
        play(lamps(), GameOptions({"r1": command, "r2": ["/no/such/program"]}, limits=PATIENT))
    if pid.exists() and pid.read_text():  # it may have been ended before
        number = int(pid.read_text())
        wait_until(partial(_has_ended, number), f"process {number} still runs")


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process that its parent has died")
def test_a_program_ends_if_robochoc_is_killed(tmp_path: Path) -> None:
    pid = tmp_path / "pid"
    stubborn = f"import os, time; open({str(pid)!r}, 'w').write(str(os.getpid()) + chr(10)); time.sleep(1000)"
    game_of_its_own = (
        "import sys; from robochoc.seats.line_process import LineProcess, exchange; "
        f"exchange({{'r': LineProcess([sys.executable, '-c', {stubborn!r}])}}, lambda *_: False, 1000)"
    )
    with subprocess.Popen([sys.executable, "-c", game_of_its_own]) as robochoc:
        wait_until(lambda: pid.exists() and pid.read_text().endswith("\n"), "the program did not start")
        robochoc.kill()
    wait_until(partial(_has_ended, int(pid.read_text())), "the program still runs")
