"""The robots of a team while its problem does not change, and the changes that may end this."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import NamedTuple, Protocol

from robochoc.communication.host import Host
from robochoc.exploration.local_steps import LocalState, LocalSteps, Step
from robochoc.model.problem import Team
from robochoc.protocols.protocol import Protocol as AnyProtocol
from robochoc.solver.agent_problem import AgentProblem
from robochoc.system.errors import RobochocError


class NotCreatedError(RobochocError):
    """Raised if the protocol object of a robot cannot be created."""


class Judge(Protocol):
    """Judges the states of a team."""

    @property
    def team(self) -> Team:
        """The team."""

    @property
    def right_answer(self) -> str:
        """The answer of a correct run, as a sentence."""

    def answer_in_words(self, robots: Sequence[LocalState], witness: int | None) -> str:
        """Return the answer when the search is over without a fault."""

    def at_the_end(self, robots: Sequence[LocalState], witness: int | None, losses: int) -> str:
        """Return the fault when the search is over; empty if there is none. `witness`: the robot that concluded it."""

    def on_the_way(self, robots: Sequence[LocalState], losses: int) -> str:
        """Return the fault in a state at any time; empty if there is none. `losses`: the number of lost messages."""


class Change(NamedTuple):
    """A change of the problem, which ends a stage and opens the next one.

    Attributes:
        in_words: The change in a few words.
        lost: The robots that crash; empty if the next event happens.
        back: Those of them that are restarted.
    """

    in_words: str = ""
    lost: tuple[str, ...] = ()
    back: tuple[str, ...] = ()


class Stage:
    """The robots of a team while its problem does not change: an epoch of a run.

    Args:
        parts: Each robot's part of the problem, by name, in priority order.
        protocol: The class of the protocol.
        judge: The judge of the robots' states.

    Attributes:
        robots: The steps of each robot.
        names: The names of the robots.
        places: The place of each robot in `robots`.
        everybody: All places.
        writers: For each robot, the places of the robots that may send it a message.
        traits: The traits of the protocol.
    """

    def __init__(self, parts: Mapping[str, AgentProblem], protocol: type[AnyProtocol], judge: Judge) -> None:
        hosts = {name: _host(name, protocol, part) for name, part in parts.items()}
        self.parts, self.protocol = parts, protocol
        self.robots = [LocalSteps(host) for host in hosts.values()]
        self.judge = judge
        self.names = [*hosts]
        self.places = {name: place for place, name in enumerate(self.names)}
        self.everybody = {*range(len(self.names))}
        self.traits = protocol.traits
        self.writers = [
            {
                self.places[name]
                for name in (hosts if self.traits.writes_to_non_neighbours else host.protocol.problem.neighbours)
            }
            - {place}
            for place, host in enumerate(hosts.values())
        ]

    @cached_property
    def changes(self) -> Sequence[Change]:
        """The changes that may end this stage."""
        return ()

    def after(self, change: Change) -> Stage:
        """Return the stage after `change`, always the same object."""
        raise NotImplementedError

    def first(self) -> list[Step]:
        """Return the states of robots that have no knowledge and are not started."""
        return [robot.first for robot in self.robots]

    def adopted(self, before: Stage, robots: Sequence[int]) -> list[Step]:
        """Return the state of each robot before its start in this stage, after the states `robots` of `before`."""
        raise NotImplementedError


def _host(name: str, protocol: type[AnyProtocol], part: AgentProblem) -> Host:
    """Return a host that is not started. Raises `NotCreatedError`, or `UnsupportedError` as the protocol does."""
    try:
        return Host.create(protocol, part)
    except RobochocError:
        raise
    except (Exception, SystemExit) as error:
        raise NotCreatedError(f"{name} cannot be created: {type(error).__name__}: {error}") from error
