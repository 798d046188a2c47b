"""One DynABT robot, alone: how it goes on when the problem changes."""

from __future__ import annotations

from robochoc.model.change import apply_changes
from robochoc.model.problem import Change, Team
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.explanation import invalidated_by
from robochoc.solver.local_problem import LocalProblem


def agent(team: Team, name: str) -> DynABT:
    """Return the protocol object of one robot: started, its outbox empty."""
    dynabt = DynABT(LocalProblem(agent_problems(team)[name]), PriorityOrder(team.order))
    dynabt.start()
    dynabt.outbox.clear()
    return dynabt


def change(dynabt: DynABT, old: Team, new: Team) -> None:
    """Change the robot's problem as runtimes do between two epochs. It must not send anything meanwhile."""
    name = dynabt.problem.agent
    dynabt.change(LocalProblem(agent_problems(new)[name]), PriorityOrder(new.order), invalidated_by(old, new))
    assert dynabt.outbox == []


def after(dynabt: DynABT, team: Team, *changes: Change, lossless: bool = True) -> list[tuple[str, Message]]:
    """Return what the robot sends when it goes on after `changes`."""
    change(dynabt, team, apply_changes(team, changes))
    dynabt.resume(lossless=lossless)
    said = list(dynabt.outbox)
    dynabt.outbox.clear()
    return said
