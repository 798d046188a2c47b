"""Makes the team of a counterexample smaller as long as a fault remains: fewer robots, constraints and values."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace

from robochoc.exploration.check import CheckedTeam, CheckOptions, case_of, explore
from robochoc.exploration.local_steps import TOO_LONG
from robochoc.exploration.team_state import Exploration
from robochoc.model.change import apply_changes, apply_possible_changes
from robochoc.model.problem import Change, RemoveAgent, RemoveConstraint, RemoveValue, Team
from robochoc.model.team_edits import ChangeError
from robochoc.solver.compile import NoLocalSolutionError
from robochoc.solver.errors import UnsupportedError

MOST_TRIES = 200
"""The maximum number of smaller teams that are explored."""
_FEW_STATES = 1000
"""The number of states that are explored of a smaller team, even if the fault was found after fewer ones."""


def reduced(found: CheckedTeam, options: CheckOptions, is_over: Callable[[], bool] = lambda: False) -> CheckedTeam:
    """Return a smaller team with a fault: no part can be left out alone, or `MOST_TRIES` teams were tried.

    Steps that do not end take seconds to find, so a team with such a fault is returned unchanged.

    Args:
        found: A team with a fault.
        options: The options of the check.
        is_over: Asked before each try, whether to stop.
    """
    most = max(_FEW_STATES, 2 * found.exploration.states)
    few = options._replace(states=min(options.states, most))
    name, tries = f"{found.team.name}-reduced", 0
    candidates = _smaller_teams(found.team)
    while TOO_LONG not in found.exploration.fault and tries < MOST_TRIES and not is_over():
        team = next(candidates, None)
        if team is None:
            break
        tries += 1
        smaller = _checked(replace(_tidied(team), name=name, dropped=()), few)
        if smaller is not None and _is_better(smaller.exploration, found.exploration):
            found, candidates = smaller, _smaller_teams(smaller.team)
    return found


def _is_better(found: Exploration, before: Exploration) -> bool:
    """Return whether there is a fault, after no more steps than `before`."""
    return bool(found.fault) and len(found.run) <= len(before.run)


def _checked(team: Team, options: CheckOptions) -> CheckedTeam | None:
    """Return the checked team; None if the protocol or an event does not accept it, or if there is no search."""
    try:
        case = case_of(team, options.protocol, options.run)
        return CheckedTeam(team, case, explore(case, options))
    except (UnsupportedError, NoLocalSolutionError, ChangeError):
        return None


def _smaller_teams(team: Team) -> Iterator[Team]:
    """Yield `team` without one event, robot, constraint or value. One robot, and a value of each variable, remain."""
    for place in range(len(team.scenario)):
        yield replace(team, scenario=(*team.scenario[:place], *team.scenario[place + 1 :]))
    for change in _removals(team):
        with suppress(ChangeError):
            yield apply_changes(team, [change])
    for place, robot in enumerate(team.robots):
        for left_out in robot.private:
            private = tuple(one for one in robot.private if one is not left_out)
            robots = (*team.robots[:place], replace(robot, private=private), *team.robots[place + 1 :])
            yield replace(team, robots=robots)


def _tidied(team: Team) -> Team:
    """Return `team` without needless links, and without the changes in its scenario that are no longer possible."""
    now, events = replace(team, scenario=()), []
    for event in team.scenario:
        now, possible = apply_possible_changes(now, event.changes)
        events.append(replace(event, changes=tuple(possible)))
    return replace(_without_needless_links(team), scenario=tuple(one for one in events if one.changes))


def _without_needless_links(team: Team) -> Team:
    """Return `team` without links between robots that no constraint needs."""
    needed: set[tuple[str, str]] = set()
    for constraint in team.constraints():
        needed.update(itertools.permutations({team.owner[name] for name in constraint.variables}, 2))
    robots = [
        replace(
            robot,
            parents=tuple(one for one in robot.parents if (robot.name, one.name) in needed),
            children=tuple(one for one in robot.children if (robot.name, one.name) in needed),
        )
        for robot in team.robots
    ]
    return replace(team, robots=tuple(robots))


def _removals(team: Team) -> Iterator[Change]:
    if len(team.robots) > 1:
        yield from (RemoveAgent(robot.name) for robot in reversed(team.robots))
    for robot in team.robots:
        for parent in robot.parents:
            for name in dict.fromkeys(one.name for one in parent.constraints):
                yield RemoveConstraint(robot.name, parent.name, name)
    for name, variable in team.variables.items():
        if len(variable.domain) > 1:
            yield from (RemoveValue(name, value) for value in reversed(list(variable.domain)))
