"""The check of a robot's constraints, and of its copies of others' constraints, against the team's decision. Pure.

It uses the problem itself, not the compiled constraints of the protocol.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice

from robochoc.communication.network.control_messages import Charge, CheckResult
from robochoc.communication.network.plausibility import MOST_CHARGES
from robochoc.model.absence import restated
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Robot


def check_constraints(
    epoch: int,
    robot: Robot,
    values: Mapping[str, int],
    learnt: Mapping[str, Sequence[Constraint]],
) -> CheckResult:
    """Return the costs of the constraints that `robot` knows.

    Args:
        epoch: The epoch of the search.
        robot: The robot.
        values: The decided values of all variables it knows. Withdrawn robots have none, and constraints over
            their variables are restated for the others or dropped (`model/absence.py`).
        learnt: Constraints that it has received from others, by their holders.
    """
    parts = [part for child in robot.children for part in child.constraints]
    known_to_it = (_in_force(one, values) for one in (*robot.private, *robot.shared, *parts))
    held = [one for one in known_to_it if one is not None]
    cost = sum(constraint.price(values) for constraint in held)
    shared = tuple(_charges(robot.name, [one for one in robot.shared if one.model != ConstraintModel.PKC], values))
    known = [*((child.name, child.copies) for child in robot.children), *learnt.items()]
    charges = (one for holder, theirs in known for one in _charges(holder, theirs, values))
    copies = tuple(islice(charges, max(0, MOST_CHARGES - len(shared))))  # others may have sent any number
    allowed = cost < INFINITE
    return CheckResult(epoch, allowed, cost if allowed else 0, len(held), shared, copies)


def _charges(holder: str, constraints: Iterable[Constraint], values: Mapping[str, int]) -> Iterator[Charge]:
    """Yield, by scope, the costs of the `constraints` of `holder` that are in force."""
    groups: dict[tuple[str, ...], list[Constraint]] = {}
    for one in constraints:
        in_force = _in_force(one, values)
        if in_force is not None:
            groups.setdefault(tuple(sorted(one.variables)), []).append(in_force)
    for variables, group in groups.items():
        yield Charge(holder, variables, len(group), sum(one.price(values) for one in group))


def _in_force(constraint: Constraint, values: Mapping[str, int]) -> Constraint | None:
    """Return `constraint` as restated without the robots that have no values; None if it is dropped."""
    return restated(constraint, {name for name in constraint.variables if name not in values})
