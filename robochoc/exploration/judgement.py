"""The properties that must hold in every order of deliveries.

The answer at the end is evaluated as that of any run (`run/evaluation.py`), and compared with all assignments:

- a solution satisfies every constraint, `optimal` has the minimum cost, and with `no-solution` there is no solution;
- a complete protocol ends with an answer, unless a lost message explains that it has none;
- at any time, the lower bound that the robots report is not above the minimum cost, and no known cost is below it;
- until a message is lost, the promises of incomplete protocols hold (`promises.py`).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from robochoc.communication.search_result import SearchResult
from robochoc.exploration.local_steps import LocalState
from robochoc.exploration.promises import Promises
from robochoc.model.costs import user_cost
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE, Assignment, ProblemKind, Team
from robochoc.run.evaluation import PhaseAnswer, Search, check_with_files, evaluate_search
from robochoc.run.incumbent import lower_bound
from robochoc.run.phases import RunPhase
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import UnsupportedError
from robochoc.system.plain_text import listed
from robochoc.verification.checker import RefutedError, assignment_cost, violations

MOST_ASSIGNMENTS = 100_000
"""The maximum number of assignments of a team."""
NO_SOLUTION_IS_WRONG = "the verdict is no-solution, but there is a solution"


class TeamJudge:
    """Judges the states of `compiled` during the search of `phase`. All assignments are tried once.

    Raises `UnsupportedError` if there are too many.

    Attributes:
        team: The team.
        minimum: The minimum cost of a solution (0 without costs), or `INFINITE` if there is no solution.
    """

    def __init__(self, compiled: CompiledTeam, phase: RunPhase) -> None:
        self._compiled, self._phase = compiled, phase
        self.team = compiled.team
        self.minimum, self._best = _cheapest(compiled.team)
        self._promises = Promises(compiled, phase, self.minimum)
        self._judged: dict[tuple[int, ...], str] = {}

    @property
    def right_answer(self) -> str:
        """The answer of a correct run, as a sentence."""
        team = self.team
        if self._best is None:
            return f"{team.name} has no solution."
        values = values_text(team, self._best)
        if team.kind == ProblemKind.DISWCSP:
            return f"The minimum cost is {user_cost(team, self.minimum)}, for example of {values}."
        return f"A solution is {values}."

    def at_the_end(self, robots: Sequence[LocalState], witness: int | None, losses: int) -> str:
        """Return the fault when the search is over; empty if there is none. `witness`: the robot that concluded it."""
        key = (*map(id, robots), losses)
        if key not in self._judged:
            self._judged[key] = self._fault_at_the_end(robots, witness, losses)
        return self._judged[key]

    def on_the_way(self, robots: Sequence[LocalState], losses: int) -> str:
        """Return the fault in a state at any time; empty if there is none. `losses`: the number of lost messages."""
        if self.minimum < INFINITE and any(one.verdict == Verdict.NO_SOLUTION for one in robots):
            return NO_SOLUTION_IS_WRONG
        bound = lower_bound({str(place): one.findings for place, one in enumerate(robots)})
        if bound is not None and bound > self.minimum:
            return f"the robots report the lower bound {bound}, but the minimum cost is {self.minimum}"
        known = [one.findings.best.cost for one in robots if one.findings.best is not None]
        if known and min(known) < self.minimum:
            return f"a robot knows an assignment with the cost {min(known)}, but the minimum cost is {self.minimum}"
        return "" if losses else self._promises.on_the_way(robots)

    def fault_of_run(self, result: SearchResult, *, is_cut: bool) -> str:
        """Return the fault of a run; empty if there is none. `is_cut`: a limit ended it, and no answer is required."""
        names, losses = list(self.team.order), result.metrics.lost_messages
        verdicts = dict.fromkeys(names) | ({} if result.witness is None else {result.witness: result.verdict})
        robots = [LocalState(verdicts[name], result.assignments[name], result.findings[name], None) for name in names]
        witness = None if result.witness is None else names.index(result.witness)
        fault = self.on_the_way(robots, losses)
        return fault if fault or is_cut else self._fault_at_the_end(robots, witness, losses)

    def _fault_at_the_end(self, robots: Sequence[LocalState], witness: int | None, losses: int) -> str:
        try:
            answer = self._answer(robots, witness, losses)
        except RefutedError as refuted:
            return str(refuted)
        if answer.verdict == Verdict.UNKNOWN and self._phase.traits.complete and not losses:
            return "the search is over without an answer, although the protocol is complete"
        if answer.verdict == Verdict.OPTIMAL and answer.cost != user_cost(self._compiled.team, self.minimum):
            return f"the verdict is optimal with the cost {answer.cost}, but the minimum cost is {self.minimum}"
        return "" if losses or witness is not None else self._promises.at_the_end(robots)

    def answer_in_words(self, robots: Sequence[LocalState], witness: int | None) -> str:
        """Return the answer when the search is over without a fault."""
        answer = self._answer(robots, witness, 0)
        values = f": {values_text(self.team, answer.assignment)}" if answer.assignment else ""
        is_costly = answer.cost is not None and self.team.kind == ProblemKind.DISWCSP
        return f"{answer.verdict}{values}{f', cost {answer.cost}' if is_costly else ''}"

    def _answer(self, robots: Sequence[LocalState], witness: int | None, losses: int) -> PhaseAnswer:
        """Return the answer of a run that ends in this state."""
        team = self._compiled.team
        verdict = Verdict.SOLUTION if witness is None else robots[witness].verdict
        result = SearchResult(
            verdict or Verdict.UNKNOWN,
            None if witness is None else team.order[witness],
            {name: one.assignment for name, one in zip(team.order, robots, strict=True)},
            replace(Metrics(), lost_messages=losses),
            findings={name: one.findings for name, one in zip(team.order, robots, strict=True)},
        )
        check = partial(check_with_files, self._phase, result, team, self._compiled)
        return evaluate_search(self._phase, Search(result, check), team.kind, partial(user_cost, team))


def values_text(team: Team, assignment: Mapping[str, int]) -> str:
    """Return an assignment as text: `V1 = 0 and V2 = red`."""
    symbols = {name: one.domain.symbols for name, one in team.variables.items()}
    return listed(
        f"{name} = {symbols[name][value] if 0 <= value < len(symbols[name]) else value}"
        for name, value in assignment.items()
    )


def _cheapest(team: Team) -> tuple[float, Assignment | None]:
    """Return the minimum cost of a solution of `team`, and such a solution; `INFINITE` and None if there is none.

    Raises:
        UnsupportedError: if there are too many assignments.
    """
    names = list(team.variables)
    number = math.prod(len(variable.domain) for variable in team.variables.values())
    if number > MOST_ASSIGNMENTS:
        what = f"{team.name} has {number:,} assignments, more than {MOST_ASSIGNMENTS:,}"
        raise UnsupportedError(f"{what}: too many to try; use a smaller team")
    least: float = INFINITE
    best: Assignment | None = None
    for values in itertools.product(*(team.variables[name].domain for name in names)):
        assignment: Assignment = dict(zip(names, values, strict=True))
        if not any(violations(team, assignment)):
            cost = assignment_cost(team, assignment) or 0
            if cost < least:
                least, best = cost, assignment
    return least, best
