"""One recorded run after another, of every protocol: its replay, its robots' states, and what its messages prove."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any, get_args

import msgspec
import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Sent, Settled
from robochoc.journal.journal import Journal, JournalRecorder, lines_of
from robochoc.privacy import Kind, Measure, PrivacyReport, privacy_of
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.shared.anytime import Step
from robochoc.replay import ReplayOptions, replay
from robochoc.replay.channels import MessageDecoder
from robochoc.replay.steps import runs_of
from robochoc.run import Options, Runtime, Withdrawal
from robochoc.run.options import ScheduleName
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.sniffer.export import embedded_answers
from robochoc.sniffer.page_data import STATES, PageData
from robochoc.sniffer.session import SnifferSession
from robochoc.sniffer.trace import Trace
from robochoc.solver.ace import AceProcess
from tests.support.asymmetric_problems import random_asymmetric_team, random_pkc_options
from tests.support.examples import count
from tests.support.replays import ENOUGH, identical, in_text, random_run, recorded

pytestmark = pytest.mark.usefixtures("quick_encryption")

WITH_STATES = 2
"""The states of all robots are looked at in the first runs of each protocol."""
WITH_RULES = (
    "a-dsa", "abt", "abt-do-retro", "abt-hyb", "acls", "adopt", "adopt-k", "afb", "afc", "afc-ng", "afc-tree",
    "agile-abt", "async-maxsum", "awc", "bnb-adopt", "bnb-adopt-fdac", "bounded-maxsum", "cbaa", "cbba", "cocoa",
    "compapo", "count-dpop", "d-gibbs", "dba", "disfc", "dpop", "dsa", "dsa-sdp", "duct", "dynabt", "gca-mgm", "gdba",
    "grape", "hs-cai", "kopt", "lamdls", "maxsum", "maxsum-ad", "mb-dpop", "mcs-mgm", "mgm", "mgm2", "mixed-dsa",
    "ncbb", "o-dpop", "p-dpop", "p2-dpop", "p32-dpop", "pt-fb", "rmb-dpop", "s-dpop", "sbt", "sfb", "ssi", "syncabb",
    "syncbb",
)  # fmt: skip
"""Protocols whose messages all have rules; in others losses are not known."""
WITHOUT = {"dpop": {"UTIL"}}
"""Messages without a rule, from robots with several variables."""
SILENT = {"p2-dpop"}
"""Protocols of these whose messages prove nothing."""
VARIANTS = {
    "adopt-k": {"heuristic": "dp", "k": "2"},
    "bnb-adopt": {"heuristic": "dp"},
    "bnb-adopt-fdac": {"level": "ac"},
    "hs-cai": {"k": "1"},
    "kopt": {"k": "4"},
    "maxsum": {"split": "0.3"},
    "mb-dpop": {"k": "1"},
    "rmb-dpop": {"k": "1"},
    "syncabb": {"phases": "2"},
}
"""Settings with which robots say other things."""


@pytest.fixture(scope="module")
def warm() -> Iterator[AceProcess]:
    """A solver for complex robots that need not be started for each team."""
    with AceProcess() as ace:
        yield ace


@pytest.mark.parametrize("protocol", protocol_names())
@count("number", fast=3, slow=100)
def test_runs_are_replayed_shown_and_prove_nothing_false(
    protocol: str, number: int, warm: AceProcess, tmp_path: Path
) -> None:
    """A replay is the same again, also from the text form; each step has a state; what is true is never excluded."""
    costs = protocol_named(protocol).traits.costs
    steps, learnt = 0, 0.0
    for seed in range(number):
        team, options = random_run(protocol, Random(f"run {protocol} {seed}"), seed)
        if seed % 2:
            options = replace(options, settings={**options.settings, **variant(protocol)})
        journal = recorded(team, options, warm)
        text = seed % 2 != costs  # of the first problem with costs all is in the binary form: there floats matter
        read = in_text(journal) if text else journal

        replayed = replay(read, ReplayOptions(solver=warm))
        assert identical(replayed) or not replayed.runs, (team, options, replayed)
        assert replayed.messages == sum(isinstance(event, Sent) for event in journal.events)
        steps += replayed.steps

        if seed < WITH_STATES and not any(robot.private for robot in team.robots):
            states = served(written(journal, tmp_path / f"{seed}", text=text))
            assert_complete(states, journal)
            assert text or states == embedded(journal)

        for report in reports(read, warm):
            if report.without_rule:
                assert protocol not in WITH_RULES or {*report.without_rule} <= WITHOUT.get(protocol, set())
                continue
            assert all(0 <= (loss.by(one) or 0) <= 1 for loss in report.losses for one in Measure)
            learnt += sum(report.system_loss(kind, Measure.ENTROPY) or 0 for kind in Kind)
    assert steps > number
    assert (learnt > 0) is (protocol not in SILENT) or protocol not in WITH_RULES


def variant(protocol: str) -> dict[str, str]:
    """Return settings with which robots say other things; local search also finds its best cycle."""
    anytime = {"anytime": "yes"} if Step in get_args(protocol_named(protocol).messages) else {}
    return {**VARIANTS.get(protocol, {}), **anytime}


def reports(journal: Journal, warm: AceProcess) -> Iterator[PrivacyReport]:
    """The report of each run; `privacy_of` raises an error if what is true was excluded."""
    for number, _ in enumerate(runs_of(journal.events), 1):
        yield privacy_of(journal, ReplayOptions(solver=warm), number)


@pytest.mark.parametrize("protocol", [name for name in protocol_names() if protocol_named(name).traits.asymmetric])
@count("number", fast=2, slow=20)
def test_of_two_sides_costs_nothing_is_concluded_together(protocol: str, number: int, warm: AceProcess) -> None:
    for seed in range(number):
        chance = Random(f"one side {protocol} {seed}")
        team = random_asymmetric_team(chance, simple=True)
        options = replace(random_pkc_options(team, protocol, chance), messages=ENOUGH)
        for report in reports(recorded(team, options, warm), warm):
            assert protocol not in WITH_RULES or not report.without_rule


def in_processes(protocol: str, warm: AceProcess) -> None:
    team, options = random_run(protocol, Random(f"processes {protocol}"), 0)
    options = replace(options, runtime=Runtime.PROCESSES, delay=0, schedule=ScheduleName.CONCURRENT, channel=None)
    assert identical(replay(recorded(team, options, warm), ReplayOptions(solver=warm)))


def test_what_was_recorded_in_processes_is_said_again(warm: AceProcess) -> None:
    in_processes("abt", warm)


@pytest.mark.more
@pytest.mark.parametrize("protocol", protocol_names()[::4])
def test_what_any_protocol_recorded_in_processes_is_said_again(protocol: str, warm: AceProcess) -> None:
    in_processes(protocol, warm)


# The states of robots, as a page gets them


def written(journal: Journal, path: Path, *, text: bool) -> Path:
    if text:
        path.write_bytes(b"".join(lines_of(journal)))
        return path
    recorder = JournalRecorder(journal.header)
    for event in journal.events:
        recorder(event)
    recorder.outcome = journal.outcome
    path.write_bytes(recorder.content())
    return path


def served(path: Path) -> dict[str, list[dict[str, Any]]]:
    """The server's answers about every robot."""
    session = SnifferSession(path)
    while session.advance():
        pass
    try:
        about = msgspec.json.decode(session.about())
        found: dict[str, list[dict[str, Any]]] = {}
        for place, robot in enumerate(about["robots"]):
            assert session.robot(place) == robot["name"]
            own = found.setdefault(robot["name"], [])
            while chunk := msgspec.json.decode(session.states(robot["name"], len(own) // STATES)):
                own += chunk
                if len(chunk) < STATES:
                    break
        return found
    finally:
        session.close()


def embedded(journal: Journal) -> dict[str, list[dict[str, Any]]]:
    """The states of every robot in an exported page."""
    trace = Trace.of(journal)
    answers = embedded_answers(PageData(trace), journal)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in trace.robots}
    for name, answer in answers.items():
        what, _, rest = name.partition(":")
        if what == "states":
            found[trace.robots[int(rest.split(":")[0])]] += msgspec.json.decode(zlib.decompress(answer))
    return found


def assert_complete(states: dict[str, list[dict[str, Any]]], journal: Journal) -> None:
    """One short state for each step of each robot, a reason for each new value, and nothing that cannot be followed.

    A robot that is looked at does what was recorded, its checks and clocks included, or its state says `replay`.
    """
    several_runs = sum(1 for _ in runs_of(journal.events)) > 1  # each begins without values
    steps = Counter(event.robot for event in journal.events if isinstance(event, Settled))
    assert {name: [state["step"] for state in own] for name, own in states.items()} == {
        name: list(range(steps[name])) for name in states
    }
    assert {*steps} <= {*states}
    for own in states.values():
        assert [state for state in own if "replay" in state["more"]] == []
        assert all(len(msgspec.json.encode(state)) < 50_000 for state in own)
        changed = [state for before, state in pairwise(own) if before["value"] != state["value"]]
        assert several_runs or all(state["why"] for state in changed)


@pytest.mark.parametrize("withdraw", [Withdrawal.MINIMUM, Withdrawal.MAXIMAL])
def test_those_that_only_say_who_steps_aside_have_states_too(withdraw: Withdrawal, tmp_path: Path) -> None:
    """By SFB or FirstFit."""
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=withdraw)
    journal = recorded(queens3d(3), options)
    states = served(written(journal, tmp_path / "journal", text=False))
    assert_complete(states, journal)
    assert states == embedded(journal)
    # Made again by its type, a charge of 0 would be 0.0, which is nine bytes rather than one.
    words = MessageDecoder(SFB)
    below = [event for event in journal.events if isinstance(event, Sent) and event.type == "Below"]
    assert bool(below) == (withdraw is Withdrawal.MINIMUM)
    for sent in below:
        content = words.content(sent)
        assert content is not None
        assert len(content) == sent.bytes
        assert words.message(content).charges[0][0] == 0  # type: ignore[attr-defined]  # it is SFB's
