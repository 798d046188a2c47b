"""What a problem requires of a protocol: whether the constraints of a robot are such that it can take them.

A run asks for all robots before it begins (`run/compatibility.py`). Across machines nobody else sees a robot's
constraints, so every robot asks for itself; that is why this stands here, where both can ask.
"""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.model.problem import ConstraintModel, Robot
from robochoc.protocols.traits import Traits

_TWO = 2


def unmet_requirement(robot: Robot, traits: Traits, owners: Mapping[str, str]) -> str:
    """Return a feature of `robot` that a protocol with these `traits` does not support; empty if there is none.

    Args:
        robot: The robot with its constraints.
        traits: The protocol's capabilities.
        owners: The names of the robots that own the variables, by the variables' names.
    """
    held_for_children = (constraint for child in robot.children for constraint in child.constraints)
    for constraint in (*robot.shared, *held_for_children):
        if constraint.model is ConstraintModel.PKC and not traits.partially_known:
            return f"{robot.name} shares a partially known constraint (PKC, {constraint.name})"
        if not traits.n_ary and len({owners.get(variable) for variable in constraint.variables}) > _TWO:
            return f"{robot.name} holds a constraint over more than two robots ({constraint.name})"
    return ""
