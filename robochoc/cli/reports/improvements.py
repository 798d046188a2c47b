"""The option `--improve`: publishes each better answer, and prints it on standard error, while the search continues."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from robochoc.cli.reports.progress import print_above

if TYPE_CHECKING:
    from robochoc.flight.mission import Mission
    from robochoc.model.outcome import EpochOutcome, Outcome
    from robochoc.model.problem import Team
    from robochoc.robots.closed_loop import ClosedLoop


class ImprovementReporter:
    """The audience of a run (`robochoc.run.improvement.Audience`). Prints a line for each answer unless `quiet`.

    If there is a closed `loop`, it publishes better answers.
    """

    def __init__(self, loop: ClosedLoop | None, *, quiet: bool) -> None:
        self._loop = loop
        self._quiet = quiet
        self._epochs: list[EpochOutcome] = []

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        """Publish an answer, and print its time and cost."""
        if len(epoch.improvements) > 1:
            epoch = replace(epoch, opened_by="a better decision")
        self._epochs.append(epoch)
        if self._loop is not None:
            self._loop.improve(epoch, withdrawn)
        if epoch.improvements and not self._quiet:
            print_above(self._line(team, epoch))

    def has_news(self, team: Team) -> bool:
        """Return whether robots have reported a change in the problem."""
        return self._loop is not None and self._loop.has_news(team)

    def mission(self, outcome: Outcome, team: Team) -> Mission | None:
        """Return the mission through all answers in order, or None if there is a single answer or several epochs."""
        if len(self._epochs) <= 1 or outcome.epochs:
            return None
        from robochoc.flight.mission import mission_of

        return mission_of(replace(outcome, epochs=tuple(self._epochs)), team)

    def _line(self, team: Team, epoch: EpochOutcome) -> str:
        from robochoc.formats import on_one_line
        from robochoc.model.cost_units import cost_shown
        from robochoc.model.problem import ProblemKind

        last = epoch.improvements[-1]
        answer = "an optimum" if last.verdict == "optimal" else "a solution"
        shown = "" if last.cost is None or team.kind == ProblemKind.DISCSP else cost_shown(last.cost)
        maximised = any(robot.costs.maximize or robot.user_units.maximize for robot in team.robots)
        cost = shown and f" {'worth' if maximised else 'of cost'} {shown}"
        without = f", {len(last.withdrawn)} of {len(team.robots)} withdrawn" if last.withdrawn else ""
        return on_one_line(f"{team.name}: {answer}{cost}{without} after {last.at_s:.1f} s")
