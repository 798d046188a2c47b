"""What a model keeps of what users add to it: constraints, terms of the objective, parts, and their lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from robochoc.model.constraint import WhenAbsent
from robochoc.modelling.numbers import Exact, exact, is_truth, shown
from robochoc.modelling.places import ModelError, ModelTypeError, Place
from robochoc.modelling.terms import Term, Variable, condition

if TYPE_CHECKING:
    from robochoc.modelling.drafts import Draft


@dataclass(frozen=True, eq=False)
class Rule:
    """A constraint of a model: what `Model.add` returns.

    Attributes:
        name: Its name.
        term: The condition.
        cost: What it costs to break it. None: it must hold.
        place: The line that added it.
        when_absent: Its meaning when a robot of its scope is absent. None: as its form implies.
    """

    name: str
    term: Term
    cost: Exact | None
    place: Place
    when_absent: WhenAbsent | None = None

    def __repr__(self) -> str:
        return f"<{self.name}: {self.term!r}{'' if self.cost is None else f', cost {shown(self.cost)}'}>"

    def drafts(self) -> Iterator[Draft]:
        """Yield the drafts of this rule. Raises `ModelError` if `restate` is not possible."""
        from robochoc.modelling.drafts import conditions, soft_condition  # noqa: PLC0415 - they need the formats

        if self.cost is None:
            in_pairs = self.when_absent != WhenAbsent.DROP  # otherwise pairs of robots that stay would remain
            drafts = conditions(self.term, self.name, self.place, in_pairs=in_pairs)
        else:
            drafts = iter([soft_condition(self.term, self.cost, self.name, self.place)])
        for draft in drafts:
            yield draft.with_when_absent(self.when_absent)


def conditions_in(given: object, place: Place) -> list[Term]:
    """Return the conditions that a user adds at once: one, or a list of them, which may hold lists.

    Raises:
        ModelError: if one is not a condition, or is Python's `False`, as `x is y` is.
    """
    if isinstance(given, Iterable) and not isinstance(given, (Term, str)):
        return [term for one in given for term in conditions_in(one, place)]
    if isinstance(given, Term):
        return [condition(given)]
    if not is_truth(given):
        raise ModelTypeError(f"{given!r} is no condition", "compare terms: x != y", place)
    if not given:
        raise ModelError("this constraint is False whatever the values are", "compare variables of the model", place)
    return []


def check_owned(term: Term, known: Mapping[str, Variable], place: Place, event: object = None) -> None:
    """Raise `ModelError` unless the variables of `term` are in this model, and there at that time."""
    for variable in term.variables:
        if known.get(variable.name) is not variable:
            raise ModelError(
                f"{variable!r}, made at {variable.place}, is no variable of this model", "use variables of one", place
            )
        if variable.joins is not None and event is None:
            hint = "add constraints with it to the event: event.add(...)"
            raise ModelError(f"{variable.owner}, made at {variable.place}, joins later", hint, place)


def exact_or_none(cost: object) -> Exact | None:
    """Return the cost of breaking a constraint; None: it must hold."""
    return None if cost is None else exact(cost)


def absence_or_none(when_absent: WhenAbsent | str | None, place: Place) -> WhenAbsent | None:
    """Return the meaning of a constraint when a robot is absent; None: as its form implies. Raises `ModelError`."""
    try:
        return None if when_absent is None else WhenAbsent(when_absent)
    except ValueError:
        known = ", ".join(WhenAbsent)
        raise ModelError(f"when_absent is {when_absent!r}", f"expected one of {known}", place) from None
