"""The constraints of a model, which `Model.add` and `ModelRobot.knows` return."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from robochoc.formats.names import is_name
from robochoc.model.constraint import WhenAbsent
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine
from robochoc.modelling.numbers import Exact, exact, is_infinite, is_truth, shown
from robochoc.modelling.terms import ModelVariable, Term, condition
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from robochoc.modelling.drafts import Draft


@dataclass(frozen=True, eq=False)
class ModelConstraint:
    """A constraint of a model, returned by `Model.add`.

    Attributes:
        name: The constraint's name.
        term: The condition.
        cost: The cost of violating the constraint. None: the constraint is hard.
        place: The line that added the constraint.
        when_absent: The constraint's meaning when a robot in its scope is absent. None: the default for its form.
        objective: The objective to which the cost belongs. Empty: the model has a single cost.
    """

    name: str
    term: Term
    cost: Exact | None
    place: SourceLine
    when_absent: WhenAbsent | None = None
    objective: str = ""

    def __repr__(self) -> str:
        return f"<{self.name}: {self.term!r}{'' if self.cost is None else f', cost {shown(self.cost)}'}>"

    def drafts(self) -> Iterator[Draft]:
        """Yield the drafts of this constraint. Raises `ModelError` if `restate` is not possible."""
        from robochoc.modelling.drafts import conditions, soft_condition  # noqa: PLC0415 - they need the formats

        if self.cost is None:
            in_pairs = self.when_absent != WhenAbsent.DROP  # pairs of the remaining robots would stay
            drafts = conditions(self.term, self.name, self.place, in_pairs=in_pairs)
        else:
            soft = soft_condition(self.term, self.cost, self.name, self.place)
            drafts = iter([replace(soft, objective=self.objective)])
        for draft in drafts:
            yield draft.with_when_absent(self.when_absent)


def conditions_in(given: object, place: SourceLine) -> list[Term]:
    """Return the conditions in `given`: a condition, or a nested list of conditions.

    Raises:
        ModelError: if an element is not a condition, or is Python's `False`, as from `x is y`.
    """
    if isinstance(given, Iterable) and not isinstance(given, (Term, str)):
        return [term for one in given for term in conditions_in(one, place)]
    if isinstance(given, Term):
        return [condition(given)]
    if not is_truth(given):
        foreign = type(given).__module__.split(".")[0] in {"cpmpy", "ortools"}
        hint = "use variables of a robot, or robochoc.from_cpmpy" if foreign else "compare terms: x != y"
        raise ModelTypeError(f"{given!r} is not a condition", hint, place)
    if not given:
        raise ModelError("this constraint is always False", "compare variables of the model", place)
    return []


def check_owned(term: Term, known: Mapping[str, ModelVariable], place: SourceLine, event: object = None) -> None:
    """Raise `ModelError` unless the model contains the variables of `term`, already at the time of `event`."""
    for variable in term.variables:
        if known.get(variable.name) is not variable:
            message = f"{variable!r}, created at {variable.place}, is not a variable of this model"
            raise ModelError(message, "use variables of one model", place)
        if variable.joins is not None and event is None:
            hint = "add its constraints to the event: event.add(...)"
            raise ModelError(f"{variable.owner}, created at {variable.place}, joins later", hint, place)


def exact_or_none(cost: object) -> Exact | None:
    """Return the exact cost of a constraint, or None for a hard constraint, whose cost is None or infinite."""
    return None if cost is None or (is_infinite(cost) and cost == math.inf) else exact(cost)


def objective_name(objective: object, place: SourceLine) -> str:
    """Return a valid name of an objective, or an empty text for the single cost. Raises `ModelError`."""
    if not isinstance(objective, str):
        raise ModelTypeError(f"invalid objective {objective!r}", "expected the name of an objective", place)
    if objective and not is_name(objective):
        raise ModelError(f"invalid objective {objective!r}", "a letter, then letters, digits, '.' and '_'", place)
    return objective


def absence_or_none(when_absent: WhenAbsent | str | None, place: SourceLine) -> WhenAbsent | None:
    """Return a valid meaning of a constraint when a robot is absent; None: the default. Raises `ModelError`."""
    try:
        return None if when_absent is None else WhenAbsent(when_absent)
    except ValueError:
        known = ", ".join(WhenAbsent)
        raise ModelError(f"invalid when_absent {when_absent!r}", f"expected one of {known}", place) from None
