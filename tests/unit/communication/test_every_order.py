"""The real master and robots in every order in which messages, reports, orders and ends of processes can arrive."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import msgspec
import pytest

from robochoc.communication.control import EpochMessage, EpochReport
from robochoc.communication.processes.robot_process import QueueRobot
from robochoc.communication.quiescence import FourCounters, MessageCounts
from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_state import SearchState
from robochoc.exploration.problems import small_teams
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.findings import NO_FINDINGS
from robochoc.protocols.message import Envelope
from robochoc.protocols.protocol import Protocol
from robochoc.run.registry import protocol_named
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.explored_robots import RobotView
from tests.support.explored_searches import Program, concluded, one_search, two_searches
from tests.support.explored_team import ExploredTeam, Found
from tests.support.scripted_senders import TEAMS, Script, all_scripts, scripted

pytestmark = plain_python_only


def explored(protocol: type[Protocol], team: Team = TEAMS[2], **options: Any) -> Found:  # noqa: ANN401 - as `ExploredTeam`
    return ExploredTeam(one_search(team, protocol), concluded, **options).explore(100_000)


@count("messages", fast=3, slow=5)
def test_the_end_of_every_pattern_of_messages_is_found_at_last_and_never_too_early(messages: int) -> None:
    for script in all_scripts(messages):
        found = explored(scripted(script))
        assert (found.fault, found.is_complete) == ("", True), (script, found)
        assert found.waves <= messages + 1


REAL = [("abt", 2, 0), ("abt", 2, 1), ("syncbb", 2, 0), ("awc", 2, 0), ("abt", 3, 0)]


@pytest.mark.parametrize(("name", "robots", "number"), REAL)
@count("states", fast=1500, slow=100_000)
def test_searches_of_real_protocols_end_as_they_should(name: str, robots: int, number: int, states: int) -> None:
    protocol = protocol_named(name)
    team = next(itertools.islice(small_teams(protocol.traits, robots, 2, 0), number, None))
    found = ExploredTeam(one_search(team, protocol), concluded, batches=True).explore(states)
    assert not found.fault, found


def test_a_conclusion_ends_the_search_while_messages_are_under_way() -> None:
    found = explored(scripted({"RA": ("RB RB",), "RB": ("RA", "RA !")}))
    assert (found.fault, found.is_complete, found.results) == ("", True, {"no-solution"})


# Faults that are planted in the code under test. Each is wrong in few orders only.

Method = Callable[..., Any]
ANSWER: Method = FourCounters.answer


def with_a_single_wave(self: FourCounters, robot: str, wave: int, counts: MessageCounts) -> None:
    """Believe the first sums that are equal."""
    ANSWER(self, robot, wave, counts)
    self.quiescent = self.due


def with_the_first_answer(self: FourCounters, robot: str, wave: int, counts: MessageCounts) -> None:
    """Forget who has not answered."""
    self.update(robot, counts)
    if wave == self._wave:
        self._unanswered.clear()
        self.quiescent = self._total == self._before and self._total.sent == self._total.received


def with_any_report(self: FourCounters, robot: str, _wave: int, counts: MessageCounts) -> None:
    """Count a report that was under way when the wave began as an answer."""
    self.update(robot, counts)
    self._unanswered.discard(robot)
    if not self._unanswered:
        self.quiescent = self._total == self._before and self._total.sent == self._total.received


def with_one_counter(self: FourCounters, robot: str, wave: int, counts: MessageCounts) -> None:
    """Compare the sums of the received messages only."""
    ANSWER(self, robot, wave, counts)
    if wave == self._wave and not self._unanswered:
        self.quiescent = self._before is not None and self._total.received == self._before.received


def without_early(self: QueueRobot, _envelope: Envelope) -> bool:
    """Drop messages that arrive before the start."""
    return self._searching


def of_any_search(self: QueueRobot, sender: str, reader: Any, packet: list[Envelope]) -> None:  # noqa: ANN401 - a stand-in
    """Accept messages that were sent in an earlier search."""
    for _, clock, content in reader.get_stamped():
        envelope = Envelope(sender, self._name, content, clock)
        if self.admit(envelope):
            packet.append(envelope)


def of_any_epoch(self: SearchState, name: str, message: EpochMessage) -> str:
    """Accept reports about an earlier search."""
    return str(HANDLE(self, name, msgspec.structs.replace(message, epoch=self.epoch)))


def never_due(_self: FourCounters) -> bool:
    """Start no wave."""
    return False


def always_due(self: FourCounters) -> bool:
    """Start a wave as soon as the last one has ended."""
    return not self._unanswered


def of_any_robot(self: SearchState, wall_s: float) -> SearchResult:
    """Return the verdict as that of the first robot."""
    result: SearchResult = RESULT(self, wall_s)
    return replace(result, witness=self.order[0])


RESULT: Method = SearchState.result
HANDLE: Method = SearchState.handle
SIX = {"RA": ("", "RB RB", "RB RB"), "RB": ("RA", "", "RA", "", "")}
FOUR = {"RA": ("", "", "RB RB"), "RB": ("RA RA", "", "")}
TWO = {"RA": ("RB",), "RB": ("", "RA")}
ONE = {"RA": ("RB",)}
SIX = {"RA": ("", "RB RB", "RB RB"), "RB": ("RA", "", "RA", "", "")}
FOUR = {"RA": ("", "", "RB RB"), "RB": ("RA RA", "", "")}
TWO = {"RA": ("RB",), "RB": ("", "RA")}
ONE = {"RA": ("RB",)}
ENDED = {"RA": ("RB RB",), "RB": ("RA", "RA !")}
"""RB concludes the search when the second message to it is under way."""


class Mutant(NamedTuple):
    """A planted fault: the methods that are replaced, the script that shows it, and how it is explored."""

    owner: type
    methods: dict[str, Any]
    script: Script
    program: Callable[..., Program] = one_search
    options: dict[str, Any] = {}  # noqa: RUF012 - never changed


LATE = {"passes": 2, "pass_s": 1.0}
SHOWN = {"passes": 2, "pass_s": 0.25}
MUTANTS = {
    "a single wave": Mutant(FourCounters, {"answer": with_a_single_wave}, FOUR),
    "the first answer": Mutant(FourCounters, {"answer": with_the_first_answer}, FOUR),
    "any report": Mutant(FourCounters, {"answer": with_any_report}, SIX),
    "one counter": Mutant(FourCounters, {"answer": with_one_counter}, FOUR, partial(one_search, shown=True), SHOWN),
    "no wave": Mutant(FourCounters, {"due": property(never_due)}, TWO),
    "endless waves": Mutant(FourCounters, {"due": property(always_due)}, TWO),
    "early messages": Mutant(QueueRobot, {"admit": without_early}, TWO, two_searches),
    "messages of another search": Mutant(QueueRobot, {"_read": of_any_search}, ENDED, two_searches),
    "reports of another search": Mutant(
        SearchState, {"handle": of_any_epoch}, ONE, partial(two_searches, timeout_s=1.0), LATE
    ),
    "another witness": Mutant(SearchState, {"result": of_any_robot}, TWO),
}


@pytest.mark.parametrize("name", MUTANTS)
def test_a_planted_fault_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, methods, script, program, options = MUTANTS[name]
    sound = ExploredTeam(program(TEAMS[2], scripted(script)), concluded, **options).explore(3000)
    assert not sound.fault
    for method, replacement in methods.items():
        monkeypatch.setattr(owner, method, replacement)
    found = ExploredTeam(program(TEAMS[2], scripted(script)), concluded, **options).explore(20_000)
    assert found.fault, found
    assert len(found.path) < 40


def in_time(result: object, robots: Mapping[str, RobotView]) -> str:
    """As `concluded`; at the deadline the verdict may be unknown, and values may be missing."""
    if isinstance(result, SearchResult) and result.verdict == Verdict.UNKNOWN:
        return "" if result.witness is None else "there is a witness of no verdict"
    return concluded(result, robots)


@pytest.mark.parametrize("script", [TWO, {"RA": ("RB",), "RB": ("", "!")}], ids=["quiescence", "conclusion"])
def test_a_verdict_that_is_known_at_the_deadline_counts_with_all_reports(script: Script) -> None:
    program = one_search(TEAMS[2], scripted(script), timeout_s=5.0)
    found = ExploredTeam(program, in_time, passes=1, pass_s=5.0).explore(100_000)
    assert (found.fault, found.is_complete, len(found.results)) == ("", True, 2)


def test_a_verdict_counts_only_with_the_reports_of_all_robots() -> None:
    state = SearchState(0, ("A", "B"))
    state.verdict = Verdict.SOLUTION
    state.handle("A", EpochReport(0, {"a": 1}, Metrics(), NO_FINDINGS))
    assert state.result(0).verdict == Verdict.UNKNOWN
    state.handle("B", EpochReport(0, {"b": 1}, Metrics(), NO_FINDINGS))
    assert state.result(0).verdict == Verdict.SOLUTION
