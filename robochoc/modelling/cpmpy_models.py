"""`robochoc.from_cpmpy`: distributes a CPMpy model (https://cpmpy.readthedocs.io) over robots. Extra: `cpmpy`.

CPMpy's operators become predicates and cost functions. `AllDifferent`, `Element`, `Table`, `Cumulative` and some others
are split here, without auxiliary variables. CPMpy decomposes other global constraints: the auxiliary variables of a
decomposition belong to the robot with the constraint's first variable.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.dialect import NameMap
from robochoc.formats.dialects.xcsp3.expressions import INVERSE, TRUE, Xcsp3Condition, disjunction
from robochoc.formats.dialects.xcsp3.objective import split_sum
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.formats.dialects.xcsp3.scheduling import ScheduledTask, post_tasks
from robochoc.formats.dialects.xcsp3.tables import post_element
from robochoc.formats.dialects.xcsp3.variables import Variables
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Expression
from robochoc.model.problem import Domain, ProblemKind, Team, Variable
from robochoc.modelling.cpmpy_terms import COMPARISONS, TRANSLATED, Translation, integer_of, is_variable
from robochoc.modelling.errors import ModelError, ModelTypeError
from robochoc.modelling.model import Model
from robochoc.modelling.numbers import whole_number

if TYPE_CHECKING:
    import cpmpy

Owner = Mapping[Any, str] | Callable[[str], str]
"""The robot of each variable: a mapping from variables or their names, or a function of a name."""


def from_cpmpy(model: cpmpy.Model, owner: Owner | None = None, name: str = "cpmpy") -> Model:
    """Return a CPMpy model as a problem for a team of robots.

    Args:
        model: The model: integer and Boolean variables, constraints, and optionally an objective. The objective is
            split into a cost function for each scope of its terms.
        owner: The robot of each variable: a mapping from variables or their names, or a function of a name. None: each
            variable has its own robot. The robots' priorities follow the order of their first variables.
        name: The name of the team.

    Returns:
        The model. Its variables have CPMpy's names, with `_` in place of characters invalid in names: `x[0]` is `x_0`.
        The model and its solutions can be indexed by CPMpy's variables: `solution[x[0]]`.

    Raises:
        ImportError: if CPMpy is not installed.
        ModelError: if an expression has no counterpart, the model is too large, or a variable has no owner.

    Example:
        >>> import cpmpy, robochoc
        >>> x = cpmpy.intvar(1, 3, shape=3, name="x")
        >>> model = cpmpy.Model(cpmpy.AllDifferent(x), maximize=2 * x[0] + x[2])
        >>> outcome = robochoc.from_cpmpy(model).solve("dpop", runtime="simulator")
        >>> outcome.cost, outcome.assignment, outcome[x[0]]
        (8, {'x_0': 3, 'x_1': 1, 'x_2': 2}, 3)
    """
    team, names = _translated(model, owner, name)
    translated = Model.of(team)
    translated.imported = names
    return translated


def cpmpy_team(model: cpmpy.Model, owner: Owner | None = None, name: str = "cpmpy") -> Team:
    """Return a CPMpy model as a team; see `from_cpmpy`."""
    return _translated(model, owner, name)[0]


def _translated(model: cpmpy.Model, owner: Owner | None, name: str) -> tuple[Team, Mapping[str, str]]:
    """Return a CPMpy model as a team, and the name in the team of each variable; see `from_cpmpy`."""
    try:
        import cpmpy  # noqa: PLC0415 - an extra
        from cpmpy.transformations.get_variables import get_variables  # noqa: PLC0415 - the same
        from cpmpy.transformations.normalize import toplevel_list  # noqa: PLC0415 - the same
    except ImportError as error:
        raise ImportError(f"from_cpmpy requires CPMpy: run pip install 'robochoc[cpmpy]' ({error})") from error
    if not isinstance(model, cpmpy.Model):
        raise ModelTypeError(f"from_cpmpy requires a cpmpy.Model, not {model!r}")
    if not (owner is None or callable(owner) or hasattr(owner, "get")):
        hint = "expected a mapping from names of variables to names of robots, or a function of a variable's name"
        raise ModelTypeError(f"owner={owner!r} is not allowed", hint)
    if isinstance(owner, Mapping):
        owner = {one.name if is_variable(one) else one: robot for one, robot in owner.items()}
    constraints = toplevel_list(model.constraints)
    has_objective = hasattr(model.objective_, "name")
    own = {one.name: one for one in get_variables([*constraints, *([model.objective_] if has_objective else [])])}
    if not own:
        raise ModelError("the CPMpy model has no variables")
    robots = _Robots({variable: _owner_of(variable, owner) for variable in own})
    posting = _posting(own, robots.names)
    translation = Translation(posting, lambda variable: robots.add(variable, posting))
    try:
        for one in constraints:
            posting.title = _title(one)
            robots.owner_of_further(get_variables([one]))
            _post_with_definitions(one, translation)
        posting.title = "objective"
        if has_objective:
            robots.owner_of_further(get_variables([model.objective_]))
            _post_objective(model.objective_, translation)
    except MistakeError as mistake:
        raise ModelError(mistake.message, mistake.hint) from None
    except RecursionError:
        raise ModelError("an expression of the CPMpy model is nested too deeply", "use variables for parts") from None
    constant = 0 if has_objective or model.objective_ is None else integer_of(model.objective_)
    units = CostUnits(model.objective_ is not None and not model.objective_is_min, 0, posting.constant + constant)
    kind = ProblemKind.DISCSP if model.objective_ is None else ProblemKind.DISWCSP
    every = [*posting.constraints, *posting.costs]
    return assemble(name, robots.variables(posting), every, kind=kind, costs=units), posting.names


class _Robots:
    """The robots that own the model's variables, and the auxiliary variables in CPMpy's decompositions.

    Args:
        owned: The robot of each variable of the model.
    """

    def __init__(self, owned: Mapping[str, str]) -> None:
        self.names = NameMap()
        self._owned = owned
        self._further: dict[str, str] = {}
        self._owner = ""

    def owner_of_further(self, variables: Sequence[Any]) -> None:
        """Assign the auxiliary variables created from now on to the robot that owns the first of `variables`."""
        self._owner = self._owned[variables[0].name] if variables else next(iter(self._owned.values()))

    def add(self, variable: Any, posting: Posting) -> Expression:  # noqa: ANN401 - CPMpy's expressions
        """Add an auxiliary variable to `posting`, and return it."""
        made = posting.add_variable(
            self.names.allowed(_pretty(variable.name)), _values(variable), "part of a decomposition"
        )
        self._further[made.name] = self._owner
        return made

    def variables(self, posting: Posting) -> dict[str, list[Variable]]:
        """Return the variables of each robot."""
        names = NameMap()
        robots: dict[str, list[Variable]] = {}
        robot_names: dict[str, str] = {}
        for original, ours in posting.names.items():
            robot = self._owned[original]
            robot_names.setdefault(robot, names.allowed(ours if robot == original else robot))
            domain = Domain(f"d_{ours}", (_as_range(posting.values[original]),))
            robots.setdefault(robot_names[robot], []).append(Variable(ours, domain))
        for ours, robot in self._further.items():
            domain = Domain(f"d_{ours}", (_as_range(posting.auxiliaries[ours].values),))
            robots[robot_names[robot]].append(Variable(ours, domain))
        return robots


def _owner_of(variable: str, owner: Owner | None) -> str:
    if owner is None:
        return variable
    robot: Any  # checked below
    if callable(owner):
        try:
            robot = owner(variable)
        except (AttributeError, TypeError) as error:
            hint = "its argument is the name of a variable, a text"
            raise ModelTypeError(f"owner failed for {variable!r}: {error}", hint) from error
    else:
        robot = owner.get(variable)
    if robot is None:
        raise ModelError(f"owner has no robot for the variable {variable!r}", "each variable needs one robot")
    if not isinstance(robot, str) and whole_number(robot) is None:
        raise ModelTypeError(f"owner returns {robot!r} for the variable {variable!r}", "expected the name of a robot")
    return str(robot)


def _title(constraint: Any) -> str:  # noqa: ANN401 - CPMpy's expressions
    return re.sub(r"[^A-Za-z0-9_.]", "_", str(getattr(constraint, "name", "C"))) or "C"


def _pretty(name: str) -> str:
    return re.sub(r"[\[\],\s]+", "_", name).strip("_")


def _values(variable: Any) -> range:  # noqa: ANN401 - CPMpy's expressions
    low, high = integer_of(variable.lb), integer_of(variable.ub)
    if high - low >= MAX_VALUES:
        hint = f"the maximum is {MAX_VALUES:,}: narrow its bounds, or use a larger unit"
        raise ModelError(f"the variable {variable.name} has {high - low + 1:,} values", hint)
    return range(low, high + 1)


def _as_range(values: Sequence[int]) -> range:
    return range(values[0], values[-1] + 1)


def _posting(own: Mapping[str, Any], names: NameMap) -> Posting:
    """Return a posting with the variables of a CPMpy model, without constraints."""
    values = {name: _values(variable) for name, variable in own.items()}
    pretty = {name: _pretty(name) for name in own}
    clear = len(set(pretty.values())) == len(pretty)
    ours = {name: names.allowed(pretty[name] if clear else name) for name in own}
    domains = {name: (part,) for name, part in values.items()}
    return Posting(Variables(dict(domains)), {name: tuple(part) for name, part in values.items()}, {}, ours)


def _post_with_definitions(constraint: Any, translation: Translation) -> None:  # noqa: ANN401 - CPMpy's expressions
    """Post a constraint that must hold, and the definitions of its auxiliary variables."""
    _post(constraint, translation)
    _post_definitions(translation)


def _post_definitions(translation: Translation) -> None:
    while translation.definitions:
        constraint, defined = translation.definitions.pop()
        if defined == TRUE:
            _post(constraint, translation)
        else:
            undefined = Apply("not", (defined,))
            translation.posting.post(disjunction([undefined, translation.boolean(constraint)]))


def _post(constraint: Any, translation: Translation) -> None:  # noqa: ANN401 - CPMpy's expressions
    """Post a constraint that must hold: tables and cumulatives directly, all others as predicates."""
    if _post_as_such(constraint, translation):
        return
    if hasattr(constraint, "decompose") and constraint.name not in TRANSLATED:
        with translation.context() as conditions:
            parts = translation.decomposed(constraint, must_hold=True)
        for condition in conditions:
            translation.posting.post(condition)
        for part in parts:
            _post(part, translation)
        return
    for part in translation.parts(constraint):
        translation.posting.post(part)


def _post_as_such(constraint: Any, translation: Translation) -> bool:  # noqa: ANN401 - CPMpy's expressions
    """Post a table, a cumulative or a comparison with an element directly. Return whether that is possible."""
    kind = getattr(constraint, "name", "")
    with translation.context() as conditions:
        match kind:
            case "table" | "negative_table":
                posted = _post_table(constraint, translation)
            case "cumulative":
                posted = _post_cumulative(constraint, translation)
            case "==" | "!=" | "<" | "<=" | ">" | ">=":
                posted = _post_element(constraint, translation)
            case _:
                return False
    if posted:
        for condition in conditions:
            translation.posting.post(condition)
    return posted


def _post_table(constraint: Any, translation: Translation) -> bool:  # noqa: ANN401 - CPMpy's expressions
    members, rows = constraint.args
    if not all(map(is_variable, _flat(members))):
        return False
    flat = [[integer_of(value) for value in row] for row in rows]
    translation.posting.post_table(translation.integers(members), flat, allowed=constraint.name == "table")
    return True


def _post_element(constraint: Any, translation: Translation) -> bool:  # noqa: ANN401 - CPMpy's expressions
    """Post a comparison with an element of an array on either side."""
    left, right = constraint.args
    operator = COMPARISONS[constraint.name]
    if not _is_element(left):
        left, right, operator = right, left, INVERSE[operator]
    if not _is_element(left):
        return False
    indexes, cells = translation.cells(left.args)
    post_element(translation.posting, indexes, cells, Xcsp3Condition(operator, translation.integer(right)))
    return True


def _is_element(term: Any) -> bool:  # noqa: ANN401 - CPMpy's expressions
    """Return whether `term` is an element of an array without terms, whose indexes are distinct variables."""
    if getattr(term, "name", "") not in {"element", "nd_element"}:
        return False
    array, *indexes = term.args
    known = all(is_variable(one) or not hasattr(one, "name") for one in _flat(array))
    return known and all(map(is_variable, indexes)) and len({one.name for one in indexes}) == len(indexes)


def _post_cumulative(constraint: Any, translation: Translation) -> bool:  # noqa: ANN401 - CPMpy's expressions
    starts, durations, *ends, demands, capacity = constraint.args
    columns = [translation.integers(_flat(column)) for column in (starts, durations, demands)]
    if any(isinstance(one, Apply) for one in columns[1]):
        return False
    if any(translation.limits(one).low < 0 for one in itertools.chain(*columns[1:])):
        return False
    posting = translation.posting
    if ends and ends[0] is not None:
        for start, duration, end in zip(columns[0], columns[1], translation.integers(_flat(ends[0])), strict=True):
            posting.post(translation.sum_is(start, duration, end))
    post_tasks(list(map(ScheduledTask, *columns)), Xcsp3Condition("le", translation.integer(capacity)), posting)
    return True


def _post_objective(objective: Any, translation: Translation) -> None:  # noqa: ANN401 - CPMpy's expressions
    with translation.context() as conditions:
        expression = translation.integer(objective)
    for condition in conditions:
        translation.posting.post(condition)
    _post_definitions(translation)
    for term in split_sum(expression):
        translation.posting.post_cost(term)


def _flat(members: Iterable[Any]) -> list[Any]:
    return list(members.flat) if hasattr(members, "flat") else list(members)
