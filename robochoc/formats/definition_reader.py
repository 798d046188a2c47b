"""Read the elements that define domains, relations, predicates, functions and topics.

docs/reference/format.md, "One robot".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Sequence

from lxml import etree

from robochoc.formats.costs import read_cost
from robochoc.formats.definitions import (
    check_domain,
    check_parameter_names,
    check_relation,
    check_tuple_count,
    expression_mistake,
    parse_once,
)
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.real_numbers import REAL_KINDS, read_real_domain, read_value_places
from robochoc.formats.symbols import SymbolTable, codes_of
from robochoc.formats.xml import attribute, line
from robochoc.model.expression import Expression, ExpressionError, SymbolNames, Type, parse
from robochoc.model.expression.fixed_point import fixed_point
from robochoc.model.problem import INFINITE, CostUnits, Domain, Function, Predicate, Relation, Semantics, Topic
from robochoc.model.real import RealParameters
from robochoc.model.waypoints import waypoint

_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_NUMERIC = re.compile(r"[-+.0-9]+$")
_RANGE = re.compile(r"([+-]?[0-9]{1,18})(?:\.\.([+-]?[0-9]{1,18}))?")


def read_integer(word: str) -> int:
    """Return the integer in `word`. Raises `MistakeError`. Digits are counted before Python converts them."""
    if not _INTEGER.fullmatch(word):
        raise MistakeError(f"'{shortened(word)}' is not an integer", "write at most 18 digits, with or without a sign")
    return int(word)


def check_count(element: etree._Element, name: str, found: int) -> None:
    """Raise `MistakeError` if the attribute `name` specifies a number other than `found`."""
    given = attribute(element, name)
    if given and int(given) != found:
        raise MistakeError(f"{name} is {given}, but there are {found}", f'write {name}="{found}" or leave it out')


def read_domain(element: etree._Element, table: SymbolTable, places: int) -> Domain:
    """Return a domain from XCSP ranges (`1..4 7 9..12`), which become ascending ranges, from symbols or an interval.

    A symbolic domain gets the symbols that are in the `table` so far. A real domain has `places` decimal places. Raises
    `MistakeError`.
    """
    name, words = attribute(element, "name"), (element.text or "").split()
    kind = attribute(element, "type")
    if kind == "real":
        domain = read_real_domain(element, places)
        check_count(element, "nbValues", len(domain))
        return domain
    if element.get("points") is not None:
        raise MistakeError("only a real domain has points", 'write type="real", or delete the points')
    if kind == "symbolic":
        codes = codes_of(words, table)
        domain = Domain(name, tuple(range(code, code + 1) for code in codes), table.names)
    else:
        domain = Domain(name, tuple(sorted(map(read_range, words), key=lambda part: part.start)))
    check_domain(domain)
    check_count(element, "nbValues", len(domain))
    return domain


def read_range(word: str) -> range:
    """Return the integers of a range such as `1..4`, or of a single integer. Raises `MistakeError`."""
    match = _RANGE.fullmatch(word)
    if not match:
        hint = "write ranges of integers of at most 18 digits: 1..4 7 9..12"
        raise MistakeError(f"'{shortened(word)}' is not a range of integers", hint)
    first, last = int(match[1]), int(match[2] or match[1])
    if first > last:
        raise MistakeError(f"the range {word} is empty", f"write {last}..{first}")
    return range(first, last + 1)


def read_relation(element: etree._Element, units: CostUnits, code: Callable[[str], int]) -> Relation:
    """Return a relation from its tuples: `1 2|2 3`, or for a soft relation `5:1 2|3:2 2`, with costs in `units`.

    A cost applies to all tuples up to the next cost. `code` returns the code of a symbol. Raises
    `MistakeError`.
    """
    semantics = Semantics(attribute(element, "semantics"))
    words = [part for part in (element.text or "").split("|") if part.strip()]
    check_tuple_count(len(words))
    costs: list[float] = []
    if semantics == Semantics.SOFT:
        words, costs = _priced(words, units)
    rows = [word.split() for word in words]
    symbolic = tuple(place for place, word in enumerate(rows[0] if rows else ()) if not _NUMERIC.match(word))
    tuples = [_values(row, symbolic, code) for row in rows]
    check_count(element, "nbTuples", len(tuples))
    name, arity = attribute(element, "name"), _arity(element, tuples)
    default = _default_cost(attribute(element, "defaultCost"), semantics, units)
    relation = Relation(name, arity, semantics, tuple(tuples), tuple(costs), default, symbolic)
    check_relation(relation)
    return relation


def _values(row: list[str], symbolic: tuple[int, ...], code: Callable[[str], int]) -> tuple[int, ...]:
    """Return the values in a tuple: in `symbolic` columns, the codes of the symbols."""
    if not symbolic:
        return tuple([read_integer(word) for word in row])
    for place in symbolic:
        if place < len(row) and _NUMERIC.match(row[place]):
            message = f"'{shortened(row[place])}' is a number in a column of symbols"
            raise MistakeError(
                message, "use only symbols or only integers in a column; the first tuple determines which"
            )
    return tuple([code(word) if place in symbolic else read_integer(word) for place, word in enumerate(row)])


def _priced(words: list[str], units: CostUnits) -> tuple[list[str], list[float]]:
    """Return the tuples without their costs, and the cost of each tuple."""
    tuples, costs = [], []
    cost: float | None = None
    for word in words:
        price, colon, values = word.rpartition(":")
        if colon:
            cost = read_cost(price.strip(), units)
        elif cost is None:
            raise MistakeError(f"the tuple '{shortened(word.strip())}' has no cost", "write cost:tuple, 5:1 2|3:2 2")
        tuples.append(values)
        costs.append(cost)
    return tuples, costs


def _default_cost(given: str, semantics: Semantics, units: CostUnits) -> float:
    if semantics == Semantics.SOFT:
        return read_cost(given, units) if given else INFINITE
    if given:
        hint = 'write semantics="soft", or delete it: supports and conflicts have no costs'
        raise MistakeError(f"a {semantics} relation cannot have a defaultCost", hint)
    return 0


def _arity(element: etree._Element, tuples: list[tuple[int, ...]]) -> int:
    """Return the specified arity, or the length of the first tuple. Raises `MistakeError` if there is neither."""
    given = attribute(element, "arity")
    if not given and not tuples:
        raise MistakeError("the relation has neither tuples nor an arity", 'write arity="2"')
    return int(given) if given else len(tuples[0])


def read_predicate(element: etree._Element, code: Callable[[str], int], places: int) -> Predicate:
    """Return a predicate from `int X symbol Y real Z` and a Boolean functional expression. Raises `MistakeError`.

    `code` returns the code of a symbol. Real numbers have `places` decimal places.
    """
    return Predicate(attribute(element, "name"), *_read_intension(element, Type.BOOLEAN, code, (places, 0)))


def read_function(element: etree._Element, code: Callable[[str], int], places: int) -> Function:
    """Return a function from `int X symbol Y real Z` and a functional expression for a number. Raises `MistakeError`.

    `code` returns the code of a symbol. Real numbers have `places` decimal places.
    """
    value_places = read_value_places(element)
    read = _read_intension(element, Type.INTEGER, code, (places, value_places))
    return Function(attribute(element, "name"), *read, value_places)


def read_topic(
    element: etree._Element,
    variables: Collection[str],
    symbolic: Sequence[str],
    code: Callable[[str], int],
    reals: tuple[Collection[str], int] = ((), 0),
) -> Topic:
    """Return a topic. Its `x`, `y`, `z` are integer expressions over the robot's own `variables`.

    The `symbolic` variables can only be compared with symbols; `code` returns the code of a symbol. `reals` are the
    real variables with their decimal places: if there are some, coordinates may have decimals. Raises `MistakeError`.
    """
    given: dict[str, Expression] = {}
    for axis in ("x", "y", "z"):
        body = element.get(axis)
        if body is not None:
            try:
                symbols = SymbolNames(symbolic, _unparsed_if_unknown(code)) if symbolic else None
                given[axis] = parse(body, variables, Type.INTEGER, symbols, decimals=bool(reals[0]))
            except ExpressionError as error:
                raise expression_mistake(f"{axis} of the topic", error) from None
    kind = attribute(element, "type") or Topic.type
    sources = given.get("x"), given.get("y"), given.get("z")
    try:
        return waypoint(attribute(element, "name"), kind, sources, *reals)
    except ExpressionError as error:
        raise expression_mistake("position of the topic", error) from None


def _unparsed_if_unknown(code: Callable[[str], int]) -> Callable[[str], int]:
    """Return `code` with the parser's exception for a word that cannot be a symbol."""

    def known_code(word: str) -> int:
        try:
            return code(word)
        except MistakeError as mistake:
            raise ValueError(mistake.message) from None

    return known_code


def _read_intension(
    element: etree._Element, wanted: Type, code: Callable[[str], int], places: tuple[int, int]
) -> tuple[tuple[str, ...], Expression, tuple[str, ...], RealParameters | None]:
    """Return the formal parameters of a predicate or function, its body, and its symbolic and real parameters.

    `places`: the decimal places of real parameters, and of the value.
    """
    parameters, kinds = _read_parameters(element.findtext("parameters") or "")
    symbolic = tuple(name for name, kind in zip(parameters, kinds, strict=True) if kind == "symbol")
    real = tuple(name for name, kind in zip(parameters, kinds, strict=True) if kind in REAL_KINDS)
    functional = element.find("expression/functional")
    body = (functional.text if functional is not None else None) or ""
    try:
        symbols = SymbolNames(symbolic, _unparsed_if_unknown(code)) if symbolic else None
        if "real" in kinds:
            source = parse(body, parameters, wanted, symbols, decimals=True)
            steps = fixed_point(source, real, places[0], wanted, places[1])
            return parameters, steps, symbolic, RealParameters(real, places[0], source)
        real_parameters = RealParameters(real, places[0]) if real else None
        if symbols:
            return parameters, parse(body, parameters, wanted, symbols), symbolic, real_parameters
        return parameters, parse_once(body, parameters, wanted), (), real_parameters
    except ExpressionError as error:
        below = body[: error.position].count("\n")
        start = line(element if functional is None else functional)
        what = f"{element.tag} {shortened(attribute(element, 'name'))}"
        raise expression_mistake(what, error, start + below) from None


def _read_parameters(text: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names in `int X symbol Y real Z`, and their kinds. Raises `MistakeError`."""
    words = text.split()
    kinds, names = tuple(words[::2]), tuple(words[1::2])
    if len(words) % 2 or not {*kinds} <= {"int", "symbol", *REAL_KINDS}:
        hint = "write int X int Y, symbol Z for a parameter that is a symbol, or real Z for a real number"
        raise MistakeError(f"invalid parameters '{shortened(' '.join(words))}'", hint)
    if {*kinds} >= {*REAL_KINDS}:
        raise MistakeError("real and steps cannot be mixed in the parameters of one definition", "write real X real Y")
    check_parameter_names(names)
    return names, kinds
