"""Names that describe a journal's messages in words: the order of the robots, their variables, and symbols."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from robochoc.formats import InvalidInputError
from robochoc.journal.team_events import GivenProblemError, TeamReader
from robochoc.model.problem import Team
from robochoc.protocols.wording import Wording
from robochoc.replay.run_names import RunNames, run_names
from robochoc.sniffer.recorded_messages import RunProtocols
from robochoc.sniffer.trace import Trace


class _DecidedVariables(Mapping[str, tuple[str, ...]]):
    """The variables that each robot has decided in the part of the journal that has been read."""

    def __init__(self, variables: Mapping[str, Mapping[str, None]]) -> None:
        self._variables = variables

    def __getitem__(self, robot: str) -> tuple[str, ...]:
        return tuple(self._variables[robot])

    def __iter__(self) -> Iterator[str]:
        return iter(self._variables)

    def __len__(self) -> int:
        return len(self._variables)


class TeamNames:
    """The known names of the robots and their variables in each run of `trace`.

    The names come from the robots' files. If the journal has no files, a robot's messages are assumed to contain the
    variables that the robot decided, which is correct for robots without private variables.
    """

    def __init__(self, trace: Trace, protocols: RunProtocols) -> None:
        self._trace = trace
        self._protocols = protocols
        self._teams: list[Team | None] = []
        self._reader = TeamReader()
        self._known: dict[int, RunNames] = {}

    def variables(self, robot: str) -> list[str]:
        """Return all known variables of a robot."""
        for number in reversed(range(len(self._trace.runs))):
            team = self._team(number)
            if team is not None and robot in team:
                return [variable.name for variable in team[robot].variables]
        return list(self._trace.variables.get(robot, ()))

    def wording(self, run: int, sender: str, receiver: str) -> Wording:
        """Return the names for describing a message in a run."""
        names = self._of_run(run)
        if not names.interfaces:
            names = names._replace(interfaces=_DecidedVariables(self._trace.variables))
        return names.wording(sender, receiver, on_tree=self._uses_tree(run))

    def labelled(self, values: Mapping[str, int]) -> Mapping[str, float | str]:
        """Return decided values, with the names of symbols known from the last run."""
        symbols = self._of_run(len(self._trace.runs) - 1).symbols if self._trace.runs else {}
        if not symbols:
            return values
        return {
            name: symbols[name][value] if 0 <= value < len(symbols.get(name, ())) else value
            for name, value in values.items()
        }

    def _uses_tree(self, run: int) -> bool:
        found = self._protocols.of_run(run)
        return found is not None and found[1].traits.tree

    def _of_run(self, number: int) -> RunNames:
        if number not in self._known:
            team = self._team(number)
            if team is None:
                return RunNames()
            self._known[number] = run_names(team, on_tree=self._uses_tree(number))
        return self._known[number]

    def _team(self, number: int) -> Team | None:
        """Return the team in a run. Each run records only the robots that have changed."""
        runs = self._trace.runs
        while len(self._teams) <= number:
            given = runs[len(self._teams)].given
            if given is None and len(self._teams) == len(runs) - 1 and not self._trace.over:
                return None  # the file may still arrive
            team = None
            if given is not None:
                try:
                    team = self._reader.team(given)
                except (GivenProblemError, InvalidInputError, ValueError):
                    team = None
            self._teams.append(team)
        return self._teams[number]
