"""`robochoc.from_cpmpy`: a model of CPMpy (https://cpmpy.readthedocs.io), split over robots. An extra: `cpmpy`.

What CPMpy says by operators becomes predicates and cost functions; `AllDifferent`, `Element`, `Table`, `Cumulative` and
some more are split here, without further variables. Other global constraints are decomposed by CPMpy itself: further
variables that it makes belong to the robot of the constraint's first variable.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.dialect import Names
from robochoc.formats.dialects.xcsp3.objective import split
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.formats.dialects.xcsp3.scheduling import Task, post_tasks
from robochoc.formats.dialects.xcsp3.tables import choose
from robochoc.formats.dialects.xcsp3.terms import Condition
from robochoc.formats.dialects.xcsp3.variables import Variables
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Expression, Name
from robochoc.model.problem import Domain, ProblemKind, Team, Variable
from robochoc.modelling.cpmpy_terms import COMPARISONS, NATIVE, Translation, integer_of, is_variable
from robochoc.modelling.model import Model

if TYPE_CHECKING:
    import cpmpy

Owner = Mapping[str, str] | Callable[[str], str]
"""The robot of each variable, by the variable's name."""


def from_cpmpy(model: cpmpy.Model, owner: Owner | None = None, name: str = "cpmpy") -> Model:
    """Return a CPMpy model as a problem for a team of robots.

    Args:
        model: The model: integer and Boolean variables, constraints, and an objective or none. The objective is split
            into a cost function for each scope of its terms.
        owner: The robot of each variable: a mapping from names of variables, or a function of them. None: each
            variable has a robot of its own. The robots' priorities follow the order of their first variables.
        name: The name of the team.

    Returns:
        The model. Its variables are called as CPMpy calls them, with `_` for what no name here has: `x[0]` is `x_0`.

    Raises:
        ImportError: if CPMpy is not installed.
        ValueError: if the model has what has no counterpart, is too large, or a variable has no owner.

    Example:
        >>> import cpmpy, robochoc
        >>> x = cpmpy.intvar(1, 3, shape=3, name="x")
        >>> model = cpmpy.Model(cpmpy.AllDifferent(x), maximize=2 * x[0] + x[2])
        >>> outcome = robochoc.from_cpmpy(model).solve("dpop", runtime="simulator")
        >>> outcome.cost, outcome.assignment
        (8, {'x_0': 3, 'x_1': 1, 'x_2': 2})
    """
    return Model.of(cpmpy_team(model, owner, name))


def cpmpy_team(model: cpmpy.Model, owner: Owner | None = None, name: str = "cpmpy") -> Team:
    """Return the team of `from_cpmpy`."""
    try:
        import cpmpy  # noqa: PLC0415 - an extra
        from cpmpy.transformations.decompose_global import decompose_in_tree, decompose_objective  # noqa: PLC0415 - the same
        from cpmpy.transformations.get_variables import get_variables  # noqa: PLC0415 - the same
        from cpmpy.transformations.normalize import toplevel_list  # noqa: PLC0415 - the same
    except ImportError as error:
        raise ImportError(f"from_cpmpy needs CPMpy; say: pip install 'robochoc[cpmpy]' ({error})") from error
    if not isinstance(model, cpmpy.Model):
        raise TypeError(f"from_cpmpy takes a cpmpy.Model, not a {type(model).__name__}")
    expressions = CpmpyExpressions(decompose_in_tree, decompose_objective, get_variables)
    constraints = toplevel_list(model.constraints)
    has_objective = hasattr(model.objective_, "name")
    every = [*constraints, model.objective_] if has_objective else constraints
    own = {variable.name: variable for variable in get_variables(every)}
    owned = {variable: _owner_of(variable, owner) for variable in own}
    minimized, further = expressions.objective(model.objective_) if has_objective else (None, [])
    if has_objective:
        expressions.note([minimized], model.objective_, own, owned)
    parts = []
    for one in [*constraints, *further]:
        found = expressions.parts(one)
        expressions.note(found, one, own, owned)
        parts += found
    if not own:
        raise ValueError("the CPMpy model has no variables")
    posting = _posting(own)
    translation = Translation(posting)
    try:
        for one in parts:
            posting.title = re.sub(r"[^A-Za-z0-9_.]", "_", str(getattr(one, "name", "C"))) or "C"
            _post(one, translation)
        posting.title = "objective"
        if minimized is not None:
            _post_objective(minimized, translation)
    except MistakeError as mistake:
        raise ValueError(f"{mistake.message} ({mistake.hint})") from None
    except RecursionError:
        raise ValueError("an expression of the CPMpy model is nested too deeply") from None
    constant = 0 if has_objective or model.objective_ is None else integer_of(model.objective_)
    units = CostUnits(model.objective_ is not None and not model.objective_is_min, 0, posting.constant + constant)
    kind = ProblemKind.DISCSP if model.objective_ is None else ProblemKind.DISWCSP
    return assemble(name, _robots(posting, owned), [*posting.constraints, *posting.costs], kind=kind, costs=units)


class CpmpyExpressions(NamedTuple):
    """What CPMpy does with its own expressions."""

    decompose: Callable[..., list[Any]]
    decompose_objective: Callable[..., tuple[Any, list[Any]]]
    variables: Callable[..., list[Any]]

    def parts(self, constraint: Any) -> list[Any]:  # noqa: ANN401 - CPMpy's expressions
        """Return what `constraint` says, without global constraints that are not translated."""
        if not hasattr(constraint, "name") or is_variable(constraint):
            return [constraint]
        return self.decompose([constraint], supported=NATIVE, supported_reified=NATIVE)

    def objective(self, objective: Any) -> tuple[Any, list[Any]]:  # noqa: ANN401 - CPMpy's expressions
        """Return an objective without what is not translated, and the constraints that it takes."""
        return self.decompose_objective(objective, supported=NATIVE, supported_reified=NATIVE)

    def note(self, parts: Sequence[Any], origin: Any, own: dict[str, Any], owned: dict[str, str]) -> None:  # noqa: ANN401
        """Note the further variables of `parts`: they belong to the robot of the first variable of `origin`."""
        first = [variable.name for variable in self.variables([origin])]
        for variable in self.variables(list(parts)):
            if variable.name not in own:
                own[variable.name] = variable
                owned[variable.name] = owned[first[0]] if first else variable.name


def _owner_of(variable: str, owner: Owner | None) -> str:
    if owner is None:
        return variable
    if callable(owner):
        return str(owner(variable))
    if variable not in owner:
        raise ValueError(f"owner says no robot for the variable {variable!r}")
    return str(owner[variable])


def _posting(own: Mapping[str, Any]) -> Posting:
    """Return the variables of a CPMpy model, with nothing posted on them."""
    domains = {}
    for name, variable in own.items():
        low, high = integer_of(variable.lb), integer_of(variable.ub)
        if high - low >= MAX_VALUES:
            raise ValueError(f"the variable {name} has {high - low + 1:,} values; {MAX_VALUES:,} are supported")
        domains[name] = (range(low, high + 1),)
    names = Names()
    pretty = {name: re.sub(r"[\[\],\s]+", "_", name).strip("_") for name in own}
    clear = len(set(pretty.values())) == len(pretty)
    ours = {name: names.of(pretty[name] if clear else name) for name in own}
    return Posting(Variables(dict(domains)), {name: tuple(part) for name, (part,) in domains.items()}, {}, ours)


def _robots(posting: Posting, owned: Mapping[str, str]) -> dict[str, list[Variable]]:
    names = Names()
    robots: dict[str, list[Variable]] = {}
    for original, ours in posting.names.items():
        domain = Domain(f"d_{ours}", (range(posting.values[original][0], posting.values[original][-1] + 1),))
        robot = owned[original]
        robots.setdefault(names.of(ours if robot == original else robot), []).append(Variable(ours, domain))
    return robots


def _post(constraint: Any, translation: Translation) -> None:  # noqa: ANN401 - CPMpy's expressions
    """Post a constraint that must hold: tables and tasks as such, all else as predicates."""
    posting = translation.posting
    kind = getattr(constraint, "name", "")
    match kind:
        case "table" | "negative_table":
            members, rows = constraint.args
            scope = [translation.integer(member) for member in _flat(members)]
            flat = [[integer_of(value) for value in row] for row in rows]
            if all(isinstance(member, Name) for member in scope):
                posting.post_table(scope, flat, allowed=kind == "table")
                return
        case "cumulative":
            if _post_cumulative(constraint, translation):
                return
        case "==" | "!=" | "<" | "<=" | ">" | ">=" if getattr(constraint.args[0], "name", "") == "element":
            array, index = constraint.args[0].args
            if is_variable(index):
                members = translation.integers(array)
                cells: dict[tuple[int, ...], Expression] = {(place,): cell for place, cell in enumerate(members)}
                condition = Condition(COMPARISONS[kind], translation.integer(constraint.args[1]))
                if not translation.take_conditions():
                    choose(posting, [translation.integer(index)], cells, condition)
                    return
    posting.post(translation.boolean(constraint))


def _post_cumulative(constraint: Any, translation: Translation) -> bool:  # noqa: ANN401 - CPMpy's expressions
    starts, durations, *ends, demands, capacity = constraint.args
    columns = [[translation.integer(one) for one in _flat(column)] for column in (starts, durations, demands)]
    posting = translation.posting
    if not all(min(posting.values_of(one)) >= 0 for one in itertools.chain(*columns[1:])):
        return False
    if ends and ends[0] is not None:
        for start, duration, end in zip(columns[0], columns[1], _flat(ends[0]), strict=True):
            posting.post(translation.sum_is(start, duration, translation.integer(end)))
    if any(not isinstance(one, Name) and hasattr(one, "arguments") for one in columns[1]):
        return False
    post_tasks(list(map(Task, *columns)), Condition("le", translation.integer(capacity)), posting)
    return True


def _post_objective(objective: Any, translation: Translation) -> None:  # noqa: ANN401 - CPMpy's expressions
    expression: Expression = translation.integer(objective)
    for condition in translation.take_conditions():
        translation.posting.post(condition)
    for term in split(expression):
        translation.posting.post_cost(term)


def _flat(members: Iterable[Any]) -> list[Any]:
    return list(members.flat) if hasattr(members, "flat") else list(members)
