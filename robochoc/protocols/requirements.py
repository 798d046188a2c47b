"""The requirements of a problem that its protocol must meet: costs, and the kinds of constraints that a robot has.

A run checks all robots before it starts (`run/compatibility`). Across machines only the robot itself knows its
constraints, so each robot checks its own. Both checks import this module.
"""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.absence import may_count_when_absent
from robochoc.model.problem import ConstraintModel, ProblemKind, Robot, WhenAbsent
from robochoc.protocols.traits import Traits
from robochoc.solver.encoding import is_soft

BREAKABLE = "a constraint that is restated when a robot is absent"
"""The end of the error text about such a constraint."""
_TWO = 2


def unmet_requirement(robot: Robot, traits: Traits, owners: Mapping[str, str]) -> str:
    """Return a feature of `robot` that a protocol with these `traits` does not support; empty if all are supported.

    Args:
        robot: The robot with its constraints.
        traits: The protocol's capabilities.
        owners: The names of the robots that own the variables, by the variables' names.
    """
    held_for_children = [constraint for child in robot.children for constraint in child.constraints]
    for constraint in (*robot.shared, *held_for_children):
        if constraint.model == ConstraintModel.PKC and is_soft(constraint) and not traits.asymmetric:
            return f"{robot.name} has costs of its own for a partially known constraint (PKC, {constraint.name})"
        if constraint.model == ConstraintModel.PKC and not traits.partially_known:
            return f"{robot.name} shares a partially known constraint (PKC, {constraint.name})"
        if not traits.n_ary and len({owners.get(variable) for variable in constraint.variables}) > _TWO:
            return f"{robot.name} holds a constraint over more than two robots ({constraint.name})"
    if traits.drops_only:
        private = [one for one in robot.private if one.when_absent == WhenAbsent.FAIL]  # others leave with the robot
        for constraint in (*private, *robot.shared, *held_for_children):
            if may_count_when_absent(constraint):
                return f"{robot.name} holds {constraint.name}, {BREAKABLE}"
    if robot.kind == ProblemKind.DISWCSP and not traits.costs:
        return f"{robot.name} has costs to minimise (DCOP)"
    return ""
