"""Simulated runs on larger teams: no fault in the protocols, and each planted fault is found."""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from robochoc.exploration.check import CheckOptions, cases_of
from robochoc.exploration.conformance import fault_in_simulation
from robochoc.exploration.problems import small_teams
from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.protocols.traits import Traits
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.testing import check_protocol
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.faulty_abt import AnyNogood

pytestmark = [plain_python_only, pytest.mark.usefixtures("quick_encryption")]


@pytest.mark.parametrize("name", protocol_names())
@count("runs", fast=3, slow=200)
def test_no_simulated_run_has_a_fault(name: str, runs: int) -> None:
    protocol = protocol_named(name)
    larger = (3, 2) if protocol.traits.encrypted_tables else (5, 3)
    teams = itertools.islice(small_teams(protocol.traits, *larger, seed=1), runs)
    options = CheckOptions(protocol, Options(protocol=name, runtime=Runtime.SIMULATOR))
    for number, (team, case) in enumerate(cases_of(teams, options)):
        assert not fault_in_simulation(case, number), team.name


class Word(Message, frozen=True):
    """A message whose sentence fails."""

    def in_words(self, words: Wording) -> str:
        return words.order[99]


class Silent(Protocol):
    """Sends one message to each robot, and gives up at the first one that it receives."""

    messages = Word
    traits = Traits(complete=False)

    def start(self) -> None:
        for name in self.order.names:
            self.send(name, Word())

    def receive(self, sender: str, message: Message) -> None:
        del sender, message
        self.conclude(Verdict.UNKNOWN)


class FailsLate(ABT):
    """Fails with more than four robots."""

    def receive(self, sender: str, message: Any) -> None:  # noqa: ANN401 - as its base
        if len(self.order.names) > 4:
            raise KeyError(sender)
        super().receive(sender, message)


class Unfinished(Protocol):
    """Lacks a method."""

    messages = Nogood

    def start(self) -> None:
        pass


@pytest.mark.parametrize(
    ("mutant", "fault"),
    [
        (Silent, "in a random run: Word.in_words: IndexError"),
        (FailsLate, r"in a random run: BadMessageError: Robot\d sent Robot\d a message \(Ok\) that cannot be used"),
    ],
)
def test_a_fault_that_small_teams_do_not_have_is_found(mutant: type[Protocol], fault: str) -> None:
    assert check_protocol(mutant, runs=0) > 20
    with pytest.raises(AssertionError, match=fault):
        check_protocol(mutant)


def test_a_run_that_is_not_the_same_again_is_a_fault() -> None:
    class Sends(Silent):
        """Sends a number of messages that depends on earlier runs."""

        runs = itertools.count()

        def start(self) -> None:
            for _ in range(1 + next(self.runs) % 7):
                super().start()

    options = CheckOptions(Sends, Options(protocol="sends", runtime=Runtime.SIMULATOR))
    ((_, case),) = cases_of(itertools.islice(small_teams(Sends.traits, 3, 2, 0), 1), options)
    assert fault_in_simulation(case, 0).startswith("two runs with the same seed differ")


def test_a_wrong_answer_is_a_fault_and_given_teams_are_run_too() -> None:
    teams = [*itertools.islice(small_teams(ABT.traits, 4, 2, 2), 90, 91)]
    options = CheckOptions(AnyNogood, Options(protocol="abt", runtime=Runtime.SIMULATOR))
    ((_, case),) = cases_of(teams, options)
    faults = {fault_in_simulation(case, seed) for seed in range(60)}
    assert "the verdict is no-solution, but there is a solution" in faults
    assert check_protocol(ABT, teams, runs=5) == check_protocol(ABT, teams, runs=0)


def test_an_unfinished_class_is_an_error() -> None:
    with pytest.raises(TypeError, match="Unfinished does not define receive"):
        check_protocol(Unfinished)  # type: ignore[type-abstract]
    with pytest.raises(ValueError, match="runs is -1; it must be 0 or more"):
        check_protocol(ABT, runs=-1)
