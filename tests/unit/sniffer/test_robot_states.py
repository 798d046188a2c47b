"""What the page is told of what robots knew: all of their steps, whatever the protocol, and whoever tells it."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import Sent, Settled
from robochoc.journal.journal import Journal, JournalRecorder, lines_of
from robochoc.protocols.optimization.sfb import SFB
from robochoc.replay.channels import MessageDecoder
from robochoc.run.options import Options, Runtime, Withdrawal
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.sniffer.embedded import embedded_answers
from robochoc.sniffer.page_data import STATES, PageData
from robochoc.sniffer.session import SnifferSession
from robochoc.sniffer.trace import Trace
from robochoc.solver.ace import AceProcess
from tests.support.replays import random_run, recorded

pytestmark = pytest.mark.usefixtures("quick_encryption")

FEWEST = Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM)
MAXIMAL = Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MAXIMAL)


@pytest.fixture(scope="module")
def warm() -> Iterator[AceProcess]:
    """A solver for complex robots that need not be started for each team."""
    with AceProcess() as ace:
        yield ace


@pytest.fixture(scope="module")
def three() -> Journal:
    """As few as possible withdraw: SFB says who."""
    return recorded(queens3d(3), FEWEST)


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
    """What the server answers about every robot."""
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
    """What an exported page holds about every robot."""
    trace = Trace.of(journal)
    answers = embedded_answers(PageData(trace), journal)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in trace.robots}
    for name, answer in answers.items():
        what, _, rest = name.partition(":")
        if what == "states":
            found[trace.robots[int(rest.split(":")[0])]] += msgspec.json.decode(zlib.decompress(answer))
    return found


def complete(states: dict[str, list[dict[str, Any]]], journal: Journal) -> None:
    """One state for each step of each robot, and nothing that could not be followed."""
    steps = Counter(event.robot for event in journal.events if isinstance(event, Settled))
    assert {name: [state["step"] for state in own] for name, own in states.items()} == {
        name: list(range(steps[name])) for name in states
    }
    assert {*steps} <= {*states}
    assert [state for own in states.values() for state in own if "replay" in state["more"]] == []


@pytest.mark.parametrize("protocol", protocol_names())
def test_all_steps_of_all_robots_have_a_state(protocol: str, warm: AceProcess, tmp_path: Path) -> None:
    costs = protocol_named(protocol).traits.costs  # otherwise nobody speaks of floating point
    team, options = random_run(protocol, Random(f"insight {protocol}"), int(costs))
    journal = recorded(team, options, warm)
    states = served(written(journal, tmp_path / "journal", text=False))
    complete(states, journal)
    assert states == embedded(journal)


@pytest.mark.parametrize("options", [FEWEST, MAXIMAL], ids=["sfb", "first-fit"])
def test_so_have_those_that_only_say_who_steps_aside(options: Options, tmp_path: Path) -> None:
    journal = recorded(queens3d(3), options)
    states = served(written(journal, tmp_path / "journal", text=False))
    complete(states, journal)
    assert states == embedded(journal)


@pytest.mark.parametrize("protocol", ["adopt", "maxsum", "bnb-adopt"])
def test_where_the_text_form_has_lost_what_was_said_all_robots_are_played(
    protocol: str, warm: AceProcess, tmp_path: Path
) -> None:
    team, options = random_run(protocol, Random(f"text {protocol}"), 1)
    journal = recorded(team, options, warm)
    states = served(written(journal, tmp_path / "journal", text=True))
    complete(states, journal)


def test_integers_where_a_message_says_float_travel_as_integers(three: Journal) -> None:
    """Made again by its type, 0 would be 0.0, which is nine bytes rather than one."""
    said = [event for event in three.events if isinstance(event, Sent) and event.type == "Below"]
    assert said
    words = MessageDecoder(SFB)
    for sent in said:
        content = words.content(sent)
        assert content is not None
        assert len(content) == sent.bytes
        assert words.message(content).charges[0][0] == 0  # type: ignore[attr-defined]  # it is SFB's
