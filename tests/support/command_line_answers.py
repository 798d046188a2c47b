"""Answers of command lines, held against brute force: the verdict, costs in the user's numbers, all claims."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from robochoc.model.absence import restated
from robochoc.model.cost_units import common_units
from robochoc.model.costs import normalized, user_cost
from robochoc.model.problem import INFINITE, Function, ProblemKind, Team
from robochoc.model.symbols import symbol_table
from robochoc.model.team_edits import without_robots
from tests.support.loose_problems import minimum_cost
from tests.support.program import robochoc_within

PAGE = {0, 2}
"""How `robochoc privacy` may end on a journal: with a table, or with why there is none."""


class Truth:
    """The least cost of a team, or the largest utility, by brute force, in the user's numbers.

    The constants in the files of `lost` robots do not count.
    """

    def __init__(self, team: Team, lost: Collection[str] = ()) -> None:
        self.team = team
        left = without_robots(team, lost)
        self._not_counted = _constant(team) - (_constant(left) if left.robots else 0)
        self.sign = -1 if common_units(robot.costs for robot in team.robots).maximize else 1
        self._counted = normalized(team)

    def best(self, without: Collection[str] = ()) -> Fraction | None:
        """Return what the best solution of the others costs; None: there is none."""
        rest = without_robots(self._counted, without)
        least = minimum_cost(rest) if rest.robots else 0
        if least == INFINITE:
            return None
        return Fraction(str(user_cost(self._counted, least, without))) - self._not_counted

    def withdrawal(self, without: Collection[str] = ()) -> tuple[int, Fraction]:
        """Return the least weight of robots that have to withdraw, and the least cost of the others then."""
        weights = {robot.name: robot.weight for robot in self.team.robots if robot.name not in without}
        every = itertools.chain.from_iterable(itertools.combinations(weights, size) for size in range(len(weights) + 1))
        found: tuple[int, Fraction] | None = None
        for weight, out in sorted((sum(weights[name] for name in out), out) for out in every):
            if found and weight > found[0]:
                return found
            best = self.best((*without, *out))
            if best is not None:
                found = min(found or (weight, best), (weight, best))
        assert found is not None
        return found

    def values(self, assignment: dict[str, int | str]) -> dict[str, int]:
        """Return an assignment as the program counts: symbols by their places."""
        symbols = symbol_table(self.team.robots)
        return {name: symbols.index(one) if isinstance(one, str) else one for name, one in assignment.items()}

    def paid(self, assignment: dict[str, int], without: Collection[str] = ()) -> Fraction | None:
        """Return what an assignment costs, constraint by constraint; None: it breaks one."""
        total = _constant(self.team) - self._not_counted
        for robot in self.team.robots:
            parts = [one for child in robot.children for one in child.constraints]
            for constraint in (*robot.private, *robot.shared, *parts):
                gone = {name for name in constraint.variables if self.team.owner[name] in without}
                in_force = restated(constraint, gone)
                if in_force is None:
                    continue
                price = in_force.price(assignment)
                if price == INFINITE:
                    return None
                whole = isinstance(constraint.definition, Function)
                total += Fraction(int(price), 1 if whole else 10**robot.costs.places)
        return total


def check_answer(team: Team, found: dict[str, Any], words: Sequence[str], what: str) -> None:
    """Check a JSON result of `team`, which does not change. Robots may be lost."""
    verdict, gone = found["verdict"], {*found["withdrawn"]}
    lost = gone & {name for epoch in (found, *found["epochs"]) for name in epoch.get("lost", ())}
    truth = Truth(team, lost)
    assert verdict in {"unknown", "no-solution"} or found["verified"], what
    if verdict == "unknown":
        assert found["reason"], what
    elif any(word.startswith("--withdraw") for word in words):
        _check_withdrawal(truth, found, (gone, lost), words, what)
    else:
        assert gone == lost, what
        best = truth.best(gone)
        assert (verdict == "no-solution") is (best is None), what
        assert verdict == "no-solution" or _cost(found) * truth.sign >= _least(truth, gone), what
        assert verdict != "optimal" or (_cost(found) == best and team.kind is ProblemKind.DISWCSP), what
    if found["assignment"] and verdict != "unknown":
        assert truth.paid(truth.values(found["assignment"]), gone) == _cost(found), what
    if found.get("bound") is not None and not any(word.startswith("--withdraw") for word in words):
        assert truth.best(lost) is None or Fraction(str(found["bound"])) * truth.sign <= _least(truth, lost), what
    if found["verdict"] in {"optimal", "no-solution"} and found.get("confirmed"):
        assert "--verify" in words, what
    check_improvements(truth, found, words, what)


def _check_withdrawal(
    truth: Truth, found: dict[str, Any], gone: tuple[set[str], set[str]], words: Sequence[str], what: str
) -> None:
    everybody, lost = gone
    weights = {robot.name: robot.weight for robot in truth.team.robots}
    least, best = truth.withdrawal(lost)
    weight = sum(weights[name] for name in everybody - lost)
    assert found["verdict"] != "no-solution", what
    assert weight >= least, what
    if found["verdict"] == "optimal":
        assert (weight, _cost(found)) == (least, best), what
    elif "--withdraw=minimum" in words:
        assert weight == least or found.get("deadline") is not None or found.get("improvements"), what
    elif found.get("deadline") is None and not found["metrics"]["lost_messages"]:
        for name in everybody - lost:
            rest = {variable.name: variable.domain for variable in truth.team[name].variables}
            for values in itertools.product(*rest.values()):
                more = {**truth.values(found["assignment"]), **dict(zip(rest, values, strict=True))}
                assert truth.paid(more, everybody - {name}) is None, what


def check_improvements(truth: Truth, found: dict[str, Any], words: Sequence[str], what: str) -> None:
    """Check that answers that were published while the search went on got better, the last of them being the answer."""
    told = found.get("improvements") or []
    assert not told or "--improve" in words, what
    if "--kill" in words:  # what was published before a loss is no answer for the others
        return
    weights = {robot.name: robot.weight for robot in truth.team.robots}
    ranks = [(sum(weights[name] for name in one.get("withdrawn", ())), _cost(one) * truth.sign) for one in told]
    assert all(better < before for before, better in itertools.pairwise(ranks)), what
    if ranks and found["verdict"] != "unknown" and not found.get("epochs"):
        assert ranks[-1][1] == _cost(found) * truth.sign, what
        assert {*told[-1].get("withdrawn", ())} == {*found.get("withdrawn", ())}, what


def check_journal(path: Path, words: Sequence[str], what: str) -> None:
    """Check that the journal of a run, if it was written, is the same when it is played, and can be measured."""
    if not path.exists():
        return
    done = robochoc_within("replay", path, "--no-cache")
    told = f"{what}{done.stdout}{done.stderr}"
    nothing = "nothing was compared" in done.stdout
    lossy = "--message-loss" in words or "--channel" in words
    assert done.returncode == 0 or (done.returncode == 1 and nothing) or (done.returncode == 2 and lossy), told
    measured = robochoc_within("privacy", path, "--no-cache")
    assert measured.returncode in PAGE or nothing, f"{what}{measured.stderr}"
    path.unlink()


def _constant(team: Team) -> Fraction:
    units = common_units(robot.costs for robot in team.robots)
    return Fraction(units.constant, 10**units.places)


def _cost(found: dict[str, Any]) -> Fraction:
    return Fraction(str(found["cost"]))


def _least(truth: Truth, without: Collection[str]) -> Fraction:
    best = truth.best(without)
    assert best is not None
    return best * truth.sign
