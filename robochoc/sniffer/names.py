"""What a journal tells of its team, for the words: the order of the robots, and the names of their variables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from robochoc.formats import InvalidInputError
from robochoc.journal.given import GivenProblemError, TeamReader
from robochoc.model.problem import Team
from robochoc.protocols.order import PseudoTree
from robochoc.sniffer.phrases import Setting
from robochoc.sniffer.trace import Trace

_TREES = {"AFCTree"}
"""Classes of protocols that work on the pseudo-tree that the order induces."""


class _Known(NamedTuple):
    order: tuple[str, ...] = ()
    interfaces: Mapping[str, tuple[str, ...]] = {}
    above: Mapping[str, tuple[str, ...]] = {}


class _Seen(Mapping[str, tuple[str, ...]]):
    """The variables that robots were seen to decide, as they are by now."""

    def __init__(self, variables: Mapping[str, Mapping[str, None]]) -> None:
        self._variables = variables

    def __getitem__(self, robot: str) -> tuple[str, ...]:
        return tuple(self._variables[robot])

    def __iter__(self) -> Iterator[str]:
        return iter(self._variables)

    def __len__(self) -> int:
        return len(self._variables)


class Names:
    """What is known of the robots in each run of `trace`.

    It comes from the files that the robots were given. Where a journal has none, the variables that a robot was seen
    to decide are taken for those that its messages are about: true of robots without private variables.
    """

    def __init__(self, trace: Trace) -> None:
        self._trace = trace
        self._teams: list[Team | None] = []
        self._reader = TeamReader()
        self._known: dict[int, _Known] = {}

    def variables(self, robot: str) -> list[str]:
        """All variables of a robot that are known of."""
        for number in reversed(range(len(self._trace.runs))):
            team = self._team(number)
            if team is not None and robot in team:
                return [variable.name for variable in team[robot].variables]
        return list(self._trace.variables.get(robot, ()))

    def setting(self, run: int, sender: str, receiver: str) -> Setting:
        """Who speaks to whom in a run, and what is known of it."""
        known = self._of_run(run)
        interfaces = known.interfaces or _Seen(self._trace.variables)
        return Setting(self._trace.runs[run].protocol, sender, receiver, known.order, known.above, interfaces)

    def _of_run(self, number: int) -> _Known:
        if number not in self._known:
            team = self._team(number)
            if team is None:
                return _Known()
            above: dict[str, tuple[str, ...]] = {}
            if self._trace.runs[number].protocol in _TREES:
                links = {robot.name: [parent.name for parent in robot.parents] for robot in team.robots}
                tree = PseudoTree.induced(team.order, links)
                above = {name: tuple(reversed(tree.ancestors(name))) for name in team.order}
            interfaces = {robot.name: robot.interface for robot in team.robots}
            self._known[number] = _Known(tuple(team.order), interfaces, above)
        return self._known[number]

    def _team(self, number: int) -> Team | None:
        """The team of a run; each says only which robots are other ones than in the run before."""
        runs = self._trace.runs
        while len(self._teams) <= number:
            given = runs[len(self._teams)].given
            if given is None and len(self._teams) == len(runs) - 1 and not self._trace.over:
                return None  # it may still come
            team = None
            if given is not None:
                try:
                    team = self._reader.team(given)
                except (GivenProblemError, InvalidInputError, ValueError):
                    team = None
            self._teams.append(team)
        return self._teams[number]
