"""`Solution`, the result of `solve`: an outcome with the user's variables and values, displayed in notebooks."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, ValuesView
from dataclasses import field
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from numbers import Real
from typing import TYPE_CHECKING, Any

from robochoc.formats.headline import describe_outcome
from robochoc.formats.result import result_json
from robochoc.model.outcome import EpochOutcome, Outcome
from robochoc.model.problem import Team
from robochoc.modelling.errors import ModelTypeError, UnknownNameError
from robochoc.modelling.operators import UndefinedTermError
from robochoc.modelling.terms import ModelVariable, Term
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from pandas import DataFrame

    from robochoc.modelling.scene_page import ScenePage


class NamedValues(dict[str, object]):
    """Values by variable name. A call returns only the values, as the method `values()` of other mappings does."""

    def __call__(self) -> ValuesView[object]:
        """Return the values without names."""
        return super().values()


@dataclass(frozen=True, kw_only=True)
class SolutionEpoch(EpochOutcome):
    """The outcome of an epoch, with the user's values.

    Attributes:
        values: The values of all variables of the robots that are not withdrawn, by name.
    """

    values: Mapping[str, object] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, kw_only=True, repr=False)
class Solution(Outcome, Mapping[str, object]):
    """An outcome with the user's values.

    A solution maps variable names to values, and is true if there is an assignment. `solution[x]` is the value of a
    variable, of a term, or of the variable named `x`.

    In the outcome, `assignment`, `epochs` and `optima` contain the integers with which robots compute: codes of
    symbols, and multiples of a common unit. `values` contains the user's values.

    Attributes:
        epochs: The epochs, each with its `values`, if there were several epochs.
        variables: The variables of the model, by name; empty for a problem from files.
        problem: The team that solved the problem. None: unknown.
        imported: The names in the team of CPMpy's variables.
    """

    epochs: tuple[SolutionEpoch, ...] = ()
    variables: Mapping[str, ModelVariable] = field(default_factory=dict, compare=False)
    problem: Team | None = field(default=None, compare=False)
    imported: Mapping[str, str] = field(default_factory=dict, compare=False)

    @classmethod
    def of(
        cls,
        outcome: Outcome,
        team: Team,
        variables: Mapping[str, ModelVariable] | None = None,
        imported: Mapping[str, str] = {},
    ) -> Solution:
        """Return an outcome of `team` as a solution."""
        same = outcome.parts(Outcome)
        values = UserValues(variables or {}, team)
        epochs = [
            SolutionEpoch(**epoch.parts(EpochOutcome), values=values(epoch.assignment)) for epoch in outcome.epochs
        ]
        return cls(**same | {"epochs": tuple(epochs)}, variables=variables or {}, problem=team, imported=imported)

    @cached_property
    def values(self) -> NamedValues:  # callable, since it is a method of other mappings
        """The values of all variables of the robots that are not withdrawn, by name."""
        return self.values_of(self.assignment)

    @cached_property
    def listed(self) -> tuple[NamedValues, ...]:
        """The values of each optimum or solution that a protocol such as `list-dpop` lists."""
        return tuple(map(self.values_of, self.optima.assignments)) if self.optima else ()

    def values_of(self, assignment: Mapping[str, int]) -> NamedValues:
        """Return the user's values for the integers in an assignment, such as the assignment of an event."""
        return UserValues(self.variables, self.problem)(assignment)

    def __bool__(self) -> bool:
        """Return whether there is an assignment."""
        return bool(self.assignment)

    def __len__(self) -> int:
        """Return the number of variables that have values."""
        return len(self.assignment)

    def __getitem__(self, what: Term | str) -> object:
        """Return the value of a variable, of a term, or of the variable with this name.

        Variables of a copy of the model, such as one solved in another process, count as variables of this solution.

        Raises:
            UnknownNameError: if the variable has no value: there is no solution, or its robot is withdrawn.
            ModelTypeError: if the key is neither a term nor a name.
        """
        if isinstance(what, ModelVariable):
            return self._value(what.name, what)
        if isinstance(what, Term):
            try:
                return what.value({variable: self[variable] for variable in what.variables})
            except UndefinedTermError:
                raise UnknownNameError(f"{what!r} has no value: its evaluation divides by zero") from None
        what = team_name(what, self.imported)
        if not isinstance(what, str):
            raise ModelTypeError(f"{what!r} is not a key", "expected a variable, a term of variables, or a name")
        return self._value(what)

    def _value(self, name: str, variable: ModelVariable | None = None) -> object:
        if name not in self.values:
            raise UnknownNameError(f"{name!r} has no value", self._why(name))
        if variable is not None and self._is_foreign(variable):
            raise UnknownNameError(f"{name!r} is a variable of another model", "its robot or its domain differs")
        return self.values[name]

    def __contains__(self, what: object) -> bool:
        """Return whether a variable, a term, or the variable with this name has a value."""
        try:
            key = team_name(what, self.imported)
            return isinstance(key, Term | str) and (self[key], True)[1]
        except UnknownNameError:
            return False

    __hash__ = Outcome.__hash__

    def _ipython_key_completions_(self) -> list[str]:
        return [*self]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the variables that have values."""
        return iter(self.assignment)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON result as a dictionary (documentation, page JSON result)."""
        numbers = {name: one for name, one in self.values.items() if isinstance(one, Real | Decimal)}
        changed = {name: _in_json(one) for name, one in numbers.items() if one != self.assignment[name]}
        result: dict[str, Any] = json.loads(result_json(self, values=changed))
        return result

    def to_frame(self) -> DataFrame:
        """Return the values as a pandas `DataFrame` with the columns `robot`, `variable`, `value` and `withdrawn`.

        Variables of withdrawn robots have no value. Requires pandas.
        """
        import pandas as pd  # noqa: PLC0415 - optional

        owner = self.problem.owner if self.problem else {}
        names = [*owner] or [*self.assignment]
        return pd.DataFrame(
            {
                "robot": [owner.get(name) for name in names],
                "variable": names,
                "value": [self.values.get(name) for name in names],
                "withdrawn": [owner.get(name) in self.withdrawn for name in names],
            }
        )

    def __repr__(self) -> str:
        robots = len(self.problem.robots) if self.problem else len(self.assignment)
        return f"<{self.team}: {describe_outcome(self, robots)}; {self.protocols}, {self.runtime}>"

    def scene(self, *, height: int = 520) -> ScenePage:
        """Return a scene in which the drones fly, in calm air, to the positions that the team decided.

        Args:
            height: The height of the scene in a notebook, in pixels.
        """
        from robochoc.modelling.scene_page import ScenePage  # noqa: PLC0415 - numpy and the viewer: start-up

        return ScenePage(self, self.problem, height=height)

    def _repr_html_(self) -> str:
        from robochoc.modelling.solution_html import solution_html  # noqa: PLC0415 - notebooks only

        return solution_html(self, self.problem, self.values)

    def _is_foreign(self, variable: ModelVariable) -> bool:
        own = self.variables.get(variable.name)
        if own is None or own is variable:
            return own is None and bool(self.variables)
        return own.owner != variable.owner or (own.codes != variable.codes and set(own.domain) != set(variable.domain))

    def _why(self, name: str) -> str:
        if not self.assignment:
            return f"the verdict is {self.verdict}"
        owner = self.problem.owner.get(name) if self.problem else None
        if owner in self.withdrawn:
            return f"{owner} is withdrawn"
        return did_you_mean(name, self.assignment, "it is not a variable of this problem")


class UserValues:
    """Converts the integers in assignments into the user's values, using a model's variables or a team's domains."""

    def __init__(self, variables: Mapping[str, ModelVariable], team: Team | None) -> None:
        self._variables = variables
        self._known = team.variables if team else {}

    def __call__(self, assignment: Mapping[str, int]) -> NamedValues:
        """Return the values by variable name."""
        return NamedValues((name, self._value(name, code)) for name, code in assignment.items())

    def _value(self, name: str, code: int) -> object:
        if name in self._variables:
            return self._variables[name].codes.value(code)
        known = self._known.get(name)
        return known.domain.label(code) if known else code


def _in_json(number: Real | Decimal) -> float | Decimal | str:
    return number if isinstance(number, Decimal) else str(number) if isinstance(number, Fraction) else float(number)


def team_name(what: Any, imported: Mapping[str, str]) -> Any:  # noqa: ANN401 - any key
    """Return the name in the team of a variable of CPMpy, or of its name. Return any other key unchanged."""
    name = what if isinstance(what, str) else getattr(what, "name", None)
    return imported.get(name, what) if imported and isinstance(name, str) else what
