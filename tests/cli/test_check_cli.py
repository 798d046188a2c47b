"""`robochoc check`: the table, JSON, the journal of a fault, and the exit statuses."""

from __future__ import annotations

import _thread
import json
import signal
from pathlib import Path

import pytest

from robochoc.formats import write_team
from robochoc.generators.random_csp import random_csp
from robochoc.journal.journal import read_journal
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace
from robochoc.system.stopping import STOP
from robochoc.system.termination import Terminated
from tests.support.compiled import plain_python_only
from tests.support.faults import PROGRAM, running
from tests.support.limits import wait_until
from tests.support.program import ROOT, robochoc_within

pytestmark = plain_python_only
SOME = ("--teams", 4, "--values", 2)


def test_the_table_and_json_have_the_same_numbers() -> None:
    table, rows = robochoc_within("check", "abt", *SOME), robochoc_within("check", "abt", *SOME, "--json")
    assert (table.returncode, rows.returncode) == (0, 0)
    found = [json.loads(line) for line in rows.stdout.splitlines()]
    shown = [line.split() for line in table.stdout.splitlines()[1:]]
    assert [[row["team"], *(str(row[key]) for key in ("robots", "states", "steps", "ends"))] for row in found] == [
        row[:-1] for row in shown
    ]
    assert all(row["complete"] and row["fault"] is None and row["path"] == [] for row in found)


def test_the_number_of_processes_does_not_change_the_results() -> None:
    one, two = (robochoc_within("check", "adopt", *SOME, "--states", 300, "--json", "--jobs", jobs) for jobs in (1, 2))
    assert one.stdout == two.stdout
    assert (one.returncode, two.returncode) == (3, 3)


@pytest.mark.more
@pytest.mark.parametrize(
    ("signum", "status"), [(STOP, 3), (signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGKILL, -9)]
)
def test_a_signal_leaves_no_process(tmp_path: Path, signum: signal.Signals, status: int) -> None:
    words = ["check", "abt", "--robots", "5", "--values", "4", "--states", "100000000", "--jobs", "2"]
    with running([PROGRAM, *words], tmp_path) as run:
        wait_until(lambda: len(run.processes()) == 3, "the processes never start")
        run.strike(signum)
        run.end()
        assert run.status() == status, run.errors()
        assert run.left_behind() == []


@pytest.mark.parametrize(("signal_of", "status"), [(KeyboardInterrupt(), 130), (Terminated(143), 143)])
def test_an_interrupted_check_reports_the_teams_explored_so_far(
    signal_of: BaseException, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = robochoc_within("check", "abt", *SOME, "--jobs", 1)
    receive, created = vars(ABT)["receive"], list[ABT]()

    def interrupted(self: ABT, sender: str, message: Message) -> None:
        if len(self.order.names) == 2 and self.problem.agent == "Robot2":
            created.append(self)
            raise signal_of
        receive(self, sender, message)

    monkeypatch.setattr(ABT, "receive", interrupted)
    done = robochoc_within("check", "abt", *SOME, "--jobs", 1)
    assert created
    assert done.returncode == status
    rows = done.stdout.splitlines()
    assert [row.split() for row in rows] == [row.split() for row in whole.stdout.splitlines()[: len(rows)]]
    assert f"{len(rows) - 1} of 4 teams explored\n" in done.stderr
    assert 1 < len(rows) < 5
    as_json = robochoc_within("check", "abt", *SOME, "--jobs", 1, "--json")
    assert (as_json.returncode, as_json.stdout.count("\n")) == (status, len(rows) - 1)


def test_a_fault_is_reported_if_its_reduction_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.exploration.judgement.TeamJudge.at_the_end", lambda *_: "it is a Sunday")
    monkeypatch.setattr("robochoc.exploration.shrinking._checked", lambda *_: _thread.interrupt_main())
    done = robochoc_within("check", "abt", *SOME, "--jobs", 1)
    assert done.returncode == 130
    assert "small-3-2-0-0: after 6 steps: it is a Sunday\n1. Robot" in done.stderr


def test_progress_is_shown_on_a_terminal_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.exploration.state_graph._OFTEN", 1)
    monkeypatch.setattr("robochoc.cli.reports.progress.REFRESH_S", 0)
    monkeypatch.setenv("TERM", "xterm")
    words = ("check", "abt", *SOME)
    assert "abt: 2 of 4 teams, " in robochoc_within(*words, terminal=True).stderr
    assert robochoc_within(*words).stderr == "194 states, no fault in any order of deliveries\n"


def test_teams_of_files_are_explored_as_far_as_the_limit_allows(tmp_path: Path) -> None:
    write_team(random_csp(3, 2, 1, 0.3, seed=1), tmp_path / "team")
    assert robochoc_within("check", "abt", tmp_path / "team").returncode == 0
    partly = robochoc_within("check", "abt", tmp_path / "team", "--states", 2)
    assert partly.returncode == 3
    assert "explored in part" in partly.stderr


def test_a_fault_ends_with_status_4_and_a_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.exploration.judgement.TeamJudge.at_the_end", lambda *_: "it is a Sunday")
    done = robochoc_within("check", "abt", *SOME, "--journal", tmp_path / "fault.journal")
    assert done.returncode == 4
    assert "steps: it is a Sunday" in done.stderr
    assert robochoc_within("replay", tmp_path / "fault.journal").returncode == 0


def test_a_protocols_fault_is_explained_and_its_journal_is_replayed_sniffed_and_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = vars(ABT)["_resolve_conflict"]

    def without_answer(self: ABT, sender: str, nogood: Nogood) -> None:
        if self._coherent(nogood):
            answer(self, sender, nogood)

    monkeypatch.setattr(ABT, "_resolve_conflict", without_answer)
    journal = tmp_path / "fault.journal"
    done = robochoc_within("check", "abt", "--teams", 18, "--journal", journal)
    assert done.returncode == 4
    assert "small-3-2-0-17-reduced: after 4 steps: the checker refutes" in done.stderr
    assert "small-3-2-0-17: after 9 steps: the checker refutes" in done.stderr
    assert "\n3. Robot2 receives from Robot3: as long as V1 = 1, V2 cannot be 1\n" in done.stderr
    assert "Robot3 has V3 = 0. The last steps: Robot3" in " ".join(done.stderr.split())
    row = json.loads(robochoc_within("check", "abt", "--teams", 18, "--json").stdout.splitlines()[-1])
    assert row["explanation"].endswith("small-3-2-0-17 has no solution.")
    assert robochoc_within("replay", journal).returncode == 0
    assert robochoc_within("privacy", journal).returncode == 0
    page = PageData(Trace.of(read_journal(journal.read_bytes())))
    assert "V2 cannot be 1" in page.details(0).decode()


def test_an_endless_run_is_reported_with_its_cycle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    receive = vars(ABT)["receive"]

    def asking_again(self: ABT, sender: str, message: Message) -> None:
        receive(self, sender, message)
        if isinstance(message, Ok):
            self.send(sender, AddLink())

    monkeypatch.setattr(ABT, "receive", asking_again)
    journal = tmp_path / "fault.journal"
    done = robochoc_within("check", "abt", "--teams", 2, "--journal", journal)
    assert done.returncode == 4
    assert "Steps 2 to 3 lead back to the state after step 1." in " ".join(done.stderr.split())
    assert journal.exists()
    row = json.loads(robochoc_within("check", "abt", "--teams", 2, "--json").stdout.splitlines()[-1])
    assert [len(row["path"]), len(row["cycle"])] == [1, 2]
    for command in ("replay", "privacy"):
        assert robochoc_within(command, journal).returncode == 0


def test_the_page_is_that_of_the_first_team_and_does_not_replace_the_journal(tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    assert robochoc_within("check", "abt", *SOME, "--html", page).returncode == 0
    assert "<title>abt: small-3-2-0-0</title>" in page.read_text()
    assert robochoc_within("check", "abt", *SOME, "--html", page, "--journal", page).returncode == 2


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["abt", "--loss", 1], "abt does not tolerate lost messages"),
        (["abt", ROOT / "instances" / "queens3d-4"], "more than 100,000: too many to try"),
        (["nonsense"], "nonsense"),
        (["abt", "--set", "speed=3"], "speed"),
    ],
)
def test_what_cannot_be_checked_is_refused(words: list[object], error: str) -> None:
    done = robochoc_within("check", *words)
    assert done.returncode == 2
    assert error in done.stderr
    assert "Traceback" not in done.stderr
