"""Replay: recorded runs come out the same again, and where they do not, the first difference is told."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import msgspec
import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.formats import read_team, write_team
from robochoc.generators.queens3d import queens3d
from robochoc.journal.events import (
    AnyEvent,
    Began,
    Decided,
    Given,
    Lost,
    Received,
    Sent,
    Settled,
    actor,
)
from robochoc.journal.journal import Header, Journal, JournalRecorder, read_journal
from robochoc.protocols.message import Message, Value
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.replay import CannotReplayError, ReplayOptions, replay
from robochoc.run import Options, Runtime, Withdrawal
from robochoc.run.scenario import ScenarioRun
from robochoc.run.this_machine import StartEvents
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.cases import cases
from tests.support.golden import odd_team
from tests.support.limits import HANG_S
from tests.support.problems import random_team
from tests.support.program import ROOT
from tests.support.replays import (
    identical,
    in_binary,
    in_text,
    recorded,
    with_events,
    with_events_as_observed,
    without_given,
)

pytestmark = pytest.mark.usefixtures("quick_encryption")

FOUR = Options(protocol="abt", runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MINIMUM)


@pytest.fixture(scope="module")
def four() -> Journal:
    """Four queens' robots search, and as few as possible withdraw: two runs."""
    return recorded(queens3d(4), FOUR)


def test_a_network_of_processes_is_one_more_runtime() -> None:
    journal = recorded(queens3d(2), Options(protocol="abt", runtime=Runtime.NETWORK, timeout=HANG_S))
    assert identical(replay(journal))


def test_events_that_never_were_in_a_file_will_do() -> None:
    journal, told = with_events_as_observed(
        random_team(Random(5)), Options(protocol="adopt", runtime=Runtime.SIMULATOR)
    )
    assert identical(replay(with_events(journal, told)))
    assert identical(replay(with_events(journal, in_binary(told))))


# What ends early


def test_a_journal_that_ends_early_is_played_as_far_as_it_goes(four: Journal) -> None:
    count = len(four.events)
    for end in (1, 2, 3, count // 3, count // 2, count - 1):
        short = replace(with_events(four, list(four.events[:end])), outcome=None)
        replayed = replay(short)
        assert not replayed.differs
        assert replayed.identical == (replayed.steps > 0)
        assert not replayed.stopped
        assert not replayed.ended
        assert replayed.steps - replayed.unfinished == sum(isinstance(event, Settled) for event in short.events)


def test_a_step_without_its_end_is_compared_up_to_there(four: Journal) -> None:
    place = next(place for place, event in enumerate(four.events) if isinstance(event, Decided))
    before = list(four.events[: place + 1])
    assert replay(with_events(four, before)).unfinished == 1
    wrong = msgspec.structs.replace(before[-1], assignment={"V1.1": 99})
    difference = replay(with_events(four, [*before[:-1], wrong])).difference
    assert difference is not None
    assert difference.recorded == wrong


def test_a_robot_that_was_told_what_is_lost_is_followed_up_to_there(four: Journal) -> None:
    events = [event for event in four.events if actor(event) != "Robot1.1"]
    replayed = replay(with_events(four, events))
    assert replayed.identical
    assert {"Robot1.2", "Robot2.1"} <= {one.robot for one in replayed.stopped}
    assert replayed.stopped[0].why == "the message Ok from Robot1.1 is not in the journal"


def test_clocks_of_machines_differ() -> None:
    """What seems to be received before it was sent can only be made again once it has been said again."""
    journal = in_text(recorded(random_team(Random(5)), Options(protocol="adopt", runtime=Runtime.SIMULATOR)))
    robots = sorted({name for event in journal.events if (name := actor(event))})
    late = {name: number * 1e6 for number, name in enumerate(robots)}
    shifted = [msgspec.structs.replace(e, t=e.t + late.get(actor(e) or "", -1)) for e in journal.events]
    shifted.sort(key=lambda event: event.t)
    assert [actor(event) for event in shifted] != [actor(event) for event in journal.events]
    assert identical(replay(with_events(journal, shifted)))


class Meteor(DynABT):
    """Robot RB is hit when it first hears of anything, if it has not been hit before."""

    flag: Path

    def receive(self, sender: str, message: Message) -> None:
        if self.problem.agent == "RB" and not self.flag.exists():
            self.flag.touch()
            os._exit(1)
        super().receive(sender, message)


@pytest.mark.parametrize("spares", [0, 1])
def test_robots_are_lost_and_come_back(spares: int, tmp_path: Path) -> None:
    write_team(odd_team(), tmp_path / "team")
    team = read_team(tmp_path / "team")
    Meteor.flag = tmp_path / "hit"
    journey = ScenarioRun(team, None, CompiledTeam, lambda: None, spares=spares, parameters=RunParameters(0, {}))
    recorder = JournalRecorder(Header(team="team", protocol="dynabt", runtime="processes", seed=0))
    events = StartEvents(recorder)
    with ProcessesRun(journey.compiled(), Meteor, observer=recorder, survive=True) as session:
        played = list(journey.epochs(session, lambda opening: events.report(Meteor, opening, session)))
    journal = read_journal(recorder.content())
    assert len(played) == 2
    assert any(isinstance(event, Lost) for event in journal.events)
    given = [event for event in journal.events if isinstance(event, Given)]
    assert given[1].fresh == (("RB",) if spares else ())
    assert not given[1].quiet
    replayed = replay(journal, ReplayOptions(protocols={"Meteor": DynABT}))
    assert replayed.identical
    assert {one.robot for one in replayed.stopped} <= {*team.order}
    assert replayed.runs == 2


# What is different


def test_one_content_that_was_changed_is_the_first_difference(four: Journal) -> None:
    chance = Random(3)
    said = [place for place, event in enumerate(four.events) if isinstance(event, Sent) and event.type == "Ok"]
    for place in chance.sample(said, 5):
        event = four.events[place]
        assert isinstance(event, Sent)
        events: list[AnyEvent] = list(four.events)
        events[place] = msgspec.structs.replace(event, content={"value": [5 - event.content["value"][0]]})
        difference = replay(with_events(four, events)).difference
        assert difference is not None
        assert (difference.robot, difference.recorded) == (event.sender, events[place])
        assert isinstance(difference.replayed, Sent)
        assert difference.replayed.content == {"value": (event.content["value"][0],)}


CHANGES: list[tuple[type[AnyEvent], dict[str, Any]]] = [
    (Settled, {"checks": 77}),
    (Settled, {"clock": 1_000_000}),
    (Sent, {"bytes": 3}),
    (Sent, {"receiver": "Robot4.4"}),
    (Sent, {"type": "AddLink"}),
    (Received, {"type": "AddLink"}),
    (Received, {"clock": 0}),
    (Decided, {"assignment": {}}),
]


def test_anything_else_that_was_changed_is_one_too(four: Journal) -> None:
    with cases() as each:
        for kind, change in CHANGES:
            with each((kind.__name__, change)):
                places = [place for place, event in enumerate(four.events) if isinstance(event, kind)]
                place = places[len(places) // 2]
                events = list(four.events)
                events[place] = msgspec.structs.replace(events[place], **change)
                assert events[place] != four.events[place]
                replayed = replay(with_events(four, events))
                assert not identical(replayed)
                if kind is not Sent:
                    assert replayed.difference is not None
                    assert replayed.difference.recorded == events[place]


class Forgetful(ABT):
    """Forgets the nogoods that it is told."""

    def _learn(self, nogood: Nogood) -> None:
        """Nothing is learnt."""


class Fragile(ABT):
    """Cannot take a nogood."""

    def _learn(self, nogood: Nogood) -> None:
        raise KeyError(nogood.value)


@pytest.mark.parametrize("every", [61, pytest.param(17, marks=pytest.mark.slow)])
def test_a_step_that_stands_there_twice_is_a_difference(four: Journal, every: int) -> None:
    """No robot begins a run twice or acts without having received a message."""
    for place, event in list(enumerate(four.events))[::every]:
        if isinstance(event, Settled):
            difference = replay(
                with_events(four, [*four.events[: place + 1], event, *four.events[place + 1 :]])
            ).difference
            assert difference is not None
            assert (difference.recorded, difference.replayed) == (event, None)


def test_a_protocol_that_was_changed_is_caught_where_it_first_does_something_else(four: Journal) -> None:
    replayed = replay(four, ReplayOptions(protocols={"ABT": Forgetful}))
    difference = replayed.difference
    assert difference is not None
    assert difference.run == 0
    assert "Nogood" in {sent.type for sent in difference.packet}
    own = [event for event in four.events if isinstance(event, Settled) and event.robot == difference.robot]
    assert difference.step < len(own)
    assert replayed.steps > 5


def test_what_a_protocol_raises_is_told_with_its_place(four: Journal) -> None:
    difference = replay(four, ReplayOptions(protocols={"ABT": Fragile})).difference
    assert difference is not None
    assert "that cannot be used: KeyError: (" in difference.raised
    assert "test_replay.py:" in difference.raised
    assert difference.replayed is None


class Stubborn(ABT):
    """Keeps nogoods whatever happens, and so finds no value any more, for ever."""

    def _update(self, agent: str, value: Value | None) -> None:
        if value is not None:
            self.view[agent] = value


def test_a_protocol_that_goes_round_in_a_circle_is_stopped(four: Journal) -> None:
    difference = replay(four, ReplayOptions(protocols={"ABT": Stubborn})).difference
    assert difference is not None
    assert "which may never end" in difference.raised


def test_delays_are_the_simulators_only() -> None:
    """A clock that is ahead is a message that was slow; in processes nothing explains it."""
    slow = recorded(queens3d(2), replace(FOUR, delay=50))
    assert identical(replay(slow))
    header = msgspec.structs.replace(slow.header, runtime="processes")
    assert not replay(replace(slow, header=header)).identical


# What cannot be played


def test_files_help_where_the_journal_does_not_say_what_robots_were_given() -> None:
    team = queens3d(3)
    journal = without_given(recorded(team, replace(FOUR, withdraw=Withdrawal.MAXIMAL)))
    with pytest.raises(CannotReplayError, match="--team DIR") as caught:
        replay(journal)
    assert not caught.value.broken
    assert identical(replay(journal, ReplayOptions(team=team)))
    masters = with_events(journal, [e for e in journal.events if not isinstance(e, Began)][: len(journal.events) // 2])
    assert replay(masters, ReplayOptions(team=team)).runs == 1


def test_settings_and_orders_that_only_the_command_line_knows() -> None:
    team = queens3d(2)
    options = Options(protocol="dsa", runtime=Runtime.SIMULATOR, settings={"cycles": "3"}, seed=4, repair=False)
    journal = without_given(recorded(team, options))
    assert not replay(journal, ReplayOptions(team=team)).identical
    assert identical(replay(journal, ReplayOptions(team=team, settings={"cycles": "3"})))
    order = tuple(reversed(team.order))
    journal = without_given(recorded(team, replace(FOUR, withdraw=None, order=order)))
    header = msgspec.structs.replace(journal.header, order=order)
    assert identical(replay(replace(journal, header=header), ReplayOptions(team=team)))


def test_a_protocol_that_is_not_installed(four: Journal) -> None:
    events = [msgspec.structs.replace(e, protocol="Telepathy") if isinstance(e, Began) else e for e in four.events]
    with pytest.raises(CannotReplayError, match="no protocol with the class 'Telepathy' is installed"):
        replay(with_events(four, events))


def test_a_journal_of_strangers_raises_nothing_else() -> None:
    """Whatever one event has become."""
    journal = recorded(queens3d(2), replace(FOUR, withdraw=None))
    lines = [msgspec.json.encode(event) for event in journal.events]
    outcomes = set()
    for seed in range(150):
        chance = Random(seed)
        place = chance.randrange(len(lines))
        line = bytearray(lines[place])
        for _ in range(chance.choice((1, 2, 5))):
            line[chance.randrange(len(line))] = chance.choice(b'019"abR[]{}.,-')
        try:
            event = msgspec.json.decode(bytes(line), type=AnyEvent)
        except (msgspec.MsgspecError, UnicodeDecodeError):
            continue
        events = list(journal.events)
        events[place] = event
        try:
            outcomes.add(replay(with_events(journal, events)).identical)
        except CannotReplayError as why:
            outcomes.add(why.broken)
    assert outcomes == {True, False}


def test_journals_of_the_first_version_which_stamped_messages_at_the_end_of_a_step_are_played_too() -> None:
    journal = read_journal((ROOT / "tests" / "data" / "version-1.journal").read_bytes())
    assert journal.header.version == 1
    assert identical(replay(journal))
    place = next(place for place, event in enumerate(journal.events) if isinstance(event, Sent) and event.type == "Ok")
    events = list(journal.events)
    sent = events[place]
    assert isinstance(sent, Sent)
    events[place] = msgspec.structs.replace(sent, content={"value": (3,)})
    assert isinstance(replay(with_events(journal, events)).difference.recorded, Sent)  # type: ignore[union-attr]
