"""What `solve` returns: an outcome that speaks of the user's variables and values, and shows itself in notebooks."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from robochoc.formats.result import result_json
from robochoc.model.headline import describe_outcome
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.modelling.meanings import UndefinedTermError
from robochoc.modelling.places import UnknownNameError
from robochoc.modelling.terms import Term, Variable
from robochoc.system.suggestions import did_you_mean

if TYPE_CHECKING:
    from robochoc.modelling.notebook.scenes import ScenePage


@dataclass(frozen=True, repr=False)
class Solution(Outcome):
    """An outcome, whose values are those that the user wrote.

    `solution[variable]` is the value of a variable, of a term of variables, or of the variable of that name.

    Attributes:
        variables: The variables of the model, by name; empty for a problem from files.
        problem: The team that has solved it. None: it is not known.
    """

    variables: Mapping[str, Variable] = field(default_factory=dict, compare=False)
    problem: Team | None = field(default=None, compare=False)

    @classmethod
    def of(cls, outcome: Outcome, team: Team, variables: Mapping[str, Variable] | None = None) -> Solution:
        """Return an outcome of `team` as a solution."""
        same: dict[str, Any] = {one.name: getattr(outcome, one.name) for one in fields(Outcome)}
        return cls(**same, variables=variables or {}, problem=team)

    @cached_property
    def values(self) -> dict[str, object]:
        """The values of all variables of the robots that are not withdrawn, by name."""
        return {name: self._told(name, value) for name, value in self.assignment.items()}

    def __getitem__(self, what: Term | str) -> object:
        """Return the value of a variable or a term, or of the variable that is called so.

        Raises:
            UnknownNameError: if it has none: there is no solution, or its robot is withdrawn.
        """
        name = what if isinstance(what, str) else what.name if isinstance(what, Variable) else None
        if isinstance(what, Term) and name is None:
            try:
                return what.value({variable: self[variable] for variable in what.variables})
            except UndefinedTermError:
                raise UnknownNameError(f"{what!r} has no value: a division by zero") from None
        if name in self.values and not (isinstance(what, Variable) and self._is_foreign(what)):
            return self.values[str(name)]
        raise UnknownNameError(f"{name!r} has no value", self._why(str(name)))

    def __contains__(self, what: object) -> bool:
        """Return whether a variable, or the variable of that name, has a value."""
        return (what.name if isinstance(what, Variable) else what) in self.assignment

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the variables that have values."""
        return iter(self.assignment)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON result as a dictionary (docs/reference/result.md)."""
        told: dict[str, Any] = json.loads(result_json(self))
        return told

    def __repr__(self) -> str:
        robots = len(self.problem.robots) if self.problem else len(self.assignment)
        return f"<{self.team}: {describe_outcome(self, robots)}; {self.protocols}, {self.runtime}>"

    def scene(self, *, height: int = 520) -> ScenePage:
        """Return the scene: the drones fly to where the team has decided, in calm air.

        Args:
            height: Its height in a notebook, in pixels.
        """
        from robochoc.modelling.notebook.scenes import ScenePage  # noqa: PLC0415 - numpy and the viewer: start-up

        return ScenePage(self, self.problem, height=height)

    def _repr_html_(self) -> str:
        from robochoc.modelling.notebook.pages import solution_html  # noqa: PLC0415 - notebooks only

        return solution_html(self)

    def _is_foreign(self, variable: Variable) -> bool:
        return bool(self.variables) and self.variables.get(variable.name) is not variable

    def _told(self, name: str, value: int) -> object:
        if name in self.variables:
            return self.variables[name].codes.value(value)
        known = self.problem.variables.get(name) if self.problem else None
        return known.domain.label(value) if known else value

    def _why(self, name: str) -> str:
        if not self.assignment:
            return f"the verdict is {self.verdict}"
        owner = self.problem.owner.get(name) if self.problem else None
        if owner in self.withdrawn:
            return f"{owner} is withdrawn"
        return did_you_mean(name, self.assignment, "it is no variable of this problem")
