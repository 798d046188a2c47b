"""Rules for domains, relations, predicates and topics, in files and objects (docs/reference/format.md, "One robot").

Expressions have no rules here: a tree is written as text and parsed again, so that the parser's rules apply.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from functools import lru_cache

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import BEYOND, check_cost, check_integer, check_word, digits, in_short
from robochoc.model.expression import (
    Apply,
    Constant,
    Expression,
    ExpressionError,
    Name,
    SymbolNames,
    Type,
    parse,
    text,
)
from robochoc.model.expression.parser import MAX_DEPTH, MAX_NODES
from robochoc.model.problem import Domain, Function, Predicate, ProblemKind, Relation, Semantics, Term, Topic

MAX_VALUES = 100_000
"""The maximum size of a domain."""
MAX_TUPLES = 1_000_000
"""The maximum number of tuples in a relation."""

_PARAMETER = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")
_OPERATORS = {"eq": "eq", "ne": "ne", "neq": "ne", "lt": "lt", "le": "le", "gt": "gt", "ge": "ge"}

PREDEFINED: dict[str, Predicate] = {
    name: Predicate(name, ("X", "Y"), Apply(operator, (Name("X"), Name("Y")))) for name, operator in _OPERATORS.items()
}
"""Predicates on two terms that every file may use without defining them. `neq` is the name of `ne` in Figure 2."""


def check_domain(domain: Domain) -> None:
    """Raise `MistakeError` unless the ranges are ascending and disjoint, with 1 to `MAX_VALUES` values."""
    name = shortened(domain.name)
    for part in domain.ranges:
        check_integer(part.start)
        check_integer(part.stop - 1)
        if part.step != 1 or not part:
            wrong = f"the range {part.start}..{part.stop - 1} is empty" if part.step == 1 else f"{part} has a step"
            raise MistakeError(wrong, "use ranges of one or more integers with the step 1")
    if sum(part.stop - part.start for part in domain.ranges) > MAX_VALUES:
        raise MistakeError(f"domain {name} has more than {MAX_VALUES} values", "make it smaller")
    if not domain.ranges:
        raise MistakeError(f"domain {name} has no values", "write ranges: 1..4 7 9..12")
    for before, part in zip(domain.ranges, domain.ranges[1:], strict=False):
        if part.start < before.stop:
            if part.stop <= before.start:
                raise MistakeError(f"the ranges of domain {name} are not in order", "sort them in ascending order")
            raise MistakeError(f"the value {part.start} occurs twice in the domain", "use ranges that do not overlap")


def refuse_predefined(name: str) -> None:
    """Raise `MistakeError` if `name` is the name of a predefined predicate or a global constraint."""
    if name in PREDEFINED:
        raise MistakeError(f"'{shortened(name)}' is a predefined predicate", "rename your definition")
    if name.startswith("global:"):
        raise MistakeError(f"'{shortened(name)}' is the name of a global constraint", "rename your definition")


def check_semantics(semantics: Semantics, kind: ProblemKind) -> None:
    """Raise `MistakeError` if a robot of that `kind` cannot have relations with this `semantics`."""
    if semantics == Semantics.SOFT and kind != ProblemKind.DISWCSP:
        hint = 'write type="DisWCSP" in the presentation, or semantics="supports" or "conflicts"'
        raise MistakeError("a DisCSP cannot have a soft relation", hint)


def refuse_function(kind: ProblemKind) -> None:
    """Raise `MistakeError` if a robot of that `kind` cannot have functions, whose values are costs."""
    if kind != ProblemKind.DISWCSP:
        hint = 'write type="DisWCSP" in the presentation, or a predicate'
        raise MistakeError("a DisCSP cannot have a function, whose value is a cost", hint)


def check_relation(relation: Relation) -> None:
    """Raise `MistakeError` unless the tuples have the relation's arity and are distinct, with costs if it is soft."""
    check_tuple_count(len(relation.tuples))
    if relation.semantics != Semantics.SOFT and (relation.default_cost != 0 or relation.costs):
        wrong = "a defaultCost" if relation.default_cost != 0 else "costs"
        hint = "only soft relations have costs: make it soft, or delete them"
        raise MistakeError(f"a {relation.semantics} relation cannot have {wrong}", hint)
    if relation.arity < 1:
        message = f"a relation cannot have the arity {in_short(relation.arity)}"
        raise MistakeError(message, "each tuple has a value for each variable of the scope: use 1 or more")
    _check_tuples(relation)
    if relation.semantics == Semantics.SOFT:
        if len(relation.costs) != len(relation.tuples):
            message = f"the relation has {len(relation.tuples)} tuples, but {len(relation.costs)} costs"
            raise MistakeError(message, "write cost:tuple, 5:1 2|3:2 2")
        for cost in (*relation.costs, relation.default_cost):
            check_cost(cost)


def check_tuple_count(number: int) -> None:
    """Raise `MistakeError` if a relation has too many tuples."""
    if number > MAX_TUPLES:
        raise MistakeError(
            f"the relation has {number} tuples, more than the maximum of {MAX_TUPLES}", "write a predicate instead"
        )


def _check_tuples(relation: Relation) -> None:
    for values in relation.tuples:
        for value in values:
            check_integer(value)
        if len(values) != relation.arity:
            message = f"the tuple '{terms_text(values)}' has {len(values)} values instead of {in_short(relation.arity)}"
            raise MistakeError(message, "separate values by a blank, and tuples by '|'")
    if len(set(relation.tuples)) < len(relation.tuples):
        seen: set[tuple[int, ...]] = set()
        for values in relation.tuples:
            if values in seen:
                raise MistakeError(f"the tuple '{terms_text(values)}' occurs twice", "delete one of them")
            seen.add(values)


def check_body(definition: Predicate | Function, table: Sequence[str] = ()) -> None:
    """Raise `MistakeError` unless the body is a valid expression over the parameters.

    The body of a predicate must be Boolean, and that of a function an integer. The `table` contains the symbols.
    """
    wanted = Type.BOOLEAN if isinstance(definition, Predicate) else Type.INTEGER
    check_parameter_names(definition.parameters)
    what = f"{type(definition).__name__.lower()} {shortened(definition.name)}"
    check_expression(what, definition.body, definition.parameters, wanted, (definition.symbolic, table))


def check_parameter_names(names: Sequence[str]) -> None:
    """Raise `MistakeError` unless `names` are distinct and valid names of formal parameters."""
    seen: set[str] = set()
    for name in names:
        if not _PARAMETER.fullmatch(name):
            raise MistakeError(f"'{shortened(name)}' is not a valid name of a parameter", "write int X int Y")
        if name in seen:
            raise MistakeError(f"two parameters are called '{shortened(name)}'", "rename one of them")
        seen.add(name)


def check_topic(topic: Topic, own: Collection[str], symbolic: Sequence[str], table: Sequence[str]) -> None:
    """Raise `MistakeError` unless the coordinates of `topic` are integer expressions over the `own` variables.

    Variables in `symbolic` can only be compared with symbols, whose names are in `table`.
    """
    check_word(topic.name)
    check_word(topic.type)
    for axis, expression in (("x", topic.x), ("y", topic.y), ("z", topic.z)):
        if expression is not None:
            check_expression(f"{axis} of the topic", expression, tuple(own), Type.INTEGER, (symbolic, table))


def check_expression(
    what: str,
    expression: Expression,
    names: Sequence[str],
    wanted: Type,
    symbols: tuple[Sequence[str], Sequence[str]] = ((), ()),
) -> None:
    """Raise `MistakeError` unless the text of `expression` can be parsed, and the result is equal to `expression`.

    Args:
        what: The name of the expression in messages.
        expression: The expression.
        names: The names that it may contain.
        wanted: The type of its value.
        symbols: The names that are symbols, and the table of symbols.
    """
    try:
        _check_size(expression)
        written = text(expression, *symbols)
        if symbols[0]:
            parsed = parse(written, names, wanted, SymbolNames(symbols[0], symbols[1].index))
        else:
            parsed = parse_once(written, tuple(names), wanted)
    except ExpressionError as error:
        raise expression_mistake(what, error) from None
    if parsed != expression:
        message = f"{what}: its text '{shortened(written)}' is parsed as another expression"
        raise MistakeError(message, "use the operators of XCSP 2.1")


@lru_cache(maxsize=256)
def parse_once(written: str, names: tuple[str, ...], wanted: Type) -> Expression:
    """Parse the expression in a text. Equal texts, which are common in a team's robots, are parsed only once."""
    return parse(written, names, wanted)


def expression_mistake(what: str, error: ExpressionError, line: int = 0) -> MistakeError:
    """Return `error`, which occurred in the expression of `what` in that `line`, as an error in the file."""
    message = f"{what}: {error.message}, at character {error.position + 1}"
    return MistakeError(
        message, error.hint or "see 'Functional expressions' on the page Format of the documentation", line
    )


def _check_size(expression: object) -> None:
    """Raise `ExpressionError` for a tree that is too large for a text, or has nodes of other types."""
    waiting: list[tuple[object, int]] = [(expression, 1)]
    nodes = 0
    while waiting:
        node, depth = waiting.pop()
        nodes += 1
        if nodes > MAX_NODES:
            raise ExpressionError("the expression is too long", 0, f"use at most {MAX_NODES} operators and terms")
        if depth > MAX_DEPTH:
            raise ExpressionError("the expression is nested too deeply", 0, f"use at most {MAX_DEPTH} levels")
        match node:
            case Apply(operator=str(), arguments=tuple(arguments)):
                waiting += [(argument, depth + 1) for argument in reversed(arguments)]
            case Name(name=str()):
                pass
            case Constant(value=int(value)) if not isinstance(value, bool):
                if not -BEYOND < value < BEYOND:
                    raise ExpressionError(f"an integer has {digits(value)} digits", 0, "use at most 18 digits")
            case _:
                raise ExpressionError(
                    f"expected a term, found a {type(node).__name__}", 0, "use Constant, Name or Apply"
                )


def terms_text(terms: Sequence[Term]) -> str:
    """Return the text of a scope or a tuple for a message."""
    return shortened(" ".join(map(in_short, terms)))
