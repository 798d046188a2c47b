"""Files that each hold what one agent knows, as one instance. FRODO's `-split` writes such files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from robochoc.formats.diagnostics import shortened
from robochoc.formats.dialects.xcsp21.instance import ForeignConstraint, Formula, Instance, Sides, Table, refuse
from robochoc.model.constraint import INFINITE, Predicate


def merged(instances: Sequence[Instance]) -> Instance:
    """Return the problem of all files of a team of agents.

    Constraints of the same name, scope and contents in several files are one. Variables that several files hold are
    one, too, and must have the same domain and owner.

    Raises:
        InvalidInputError: if the files do not belong together, or one is missing.
    """
    whole = replace(instances[0], self_agent="", agents=[], variables={}, constraints=[], notes=[])
    if len(instances) > 1:
        _check_members(instances)
    _check_complete(instances)
    known: dict[tuple[str, frozenset[str]], ForeignConstraint] = {}
    for one in instances:
        whole.agents += [name for name in one.agents if name not in whole.agents]
        whole.notes += [note for note in one.notes if note not in whole.notes]
        _add_variables(whole, one)
        for constraint in one.constraints:
            if len(instances) == 1:
                whole.constraints.append(constraint)
                continue
            key = constraint.name, frozenset(constraint.scope)
            first = known.setdefault(key, constraint)
            if first is constraint:
                whole.constraints.append(constraint)
            elif not _same(first, constraint):
                if not (is_hard(first) and is_hard(constraint)):
                    hint = f"constraints of one name are copies; it also stands in {first.file}:{first.line}"
                    refuse(
                        one.file, constraint.line, f"constraint '{shortened(constraint.name)}' costs otherwise", hint
                    )
                whole.constraints.append(constraint)
    return whole


def is_hard(constraint: ForeignConstraint) -> bool:
    """Return whether a constraint only allows and forbids."""
    match constraint.content:
        case Table(costs=costs, default=default):
            return {default, *costs.values()} <= {0, INFINITE}
        case Formula(definition=Predicate(), cost=cost):
            return cost is None
        case _:
            return False


def _check_members(instances: Sequence[Instance]) -> None:
    selves = {one.self_agent: one for one in instances}
    for one in instances:
        if not one.self_agent:
            refuse(one.file, 0, "is a whole problem by itself", "import one such file at a time, or their folder")
        if selves[one.self_agent] is not one:
            other = selves[one.self_agent].file
            refuse(one.file, 0, f"is the file of agent {shortened(one.self_agent)}, and so is {other}", "leave one out")
        if one.maximize != instances[0].maximize:
            refuse(one.file, 0, f"does not maximize or minimize as {instances[0].file} does", "let them agree")


def _check_complete(instances: Sequence[Instance]) -> None:
    """Raise `InvalidInputError` when an agent has variables, and its file is not there."""
    selves = {one.self_agent for one in instances if one.self_agent}
    if not selves:
        return
    for one in instances:
        for variable in one.variables.values():
            if variable.owner and variable.owner not in selves:
                what = f"is what agent {shortened(one.self_agent)} knows, and the file of {shortened(variable.owner)}"
                refuse(one.file, variable.line, f"{what} is not here", "give all agents' files, or their folder")


def _add_variables(whole: Instance, one: Instance) -> None:
    for variable in one.variables.values():
        first = whole.variables.setdefault(variable.name, variable)
        if (first.ranges, first.owner) != (variable.ranges, variable.owner):
            what = f"variable '{shortened(variable.name)}' has another domain or agent than in another file"
            refuse(one.file, variable.line, what, "let the files agree")


def _same(one: ForeignConstraint, other: ForeignConstraint) -> bool:
    match one.content, other.content:
        case Table() as left, Table() as right:
            return (one.scope, left.costs, left.default) == (other.scope, right.costs, right.default)
        case Sides() as left, Sides() as right:
            return (one.scope, left.first.costs, left.second.costs) == (
                other.scope,
                right.first.costs,
                right.second.costs,
            )
        case Formula() as left, Formula() as right:
            named = replace(left.definition, name=""), replace(right.definition, name="")
            return named[0] == named[1] and left.terms == right.terms
        case _:
            return False
