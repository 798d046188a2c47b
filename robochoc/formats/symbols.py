"""Symbols in files: their names, the table of their codes, and type checks of constraints.

docs/reference/format.md, "Symbols".
"""

from __future__ import annotations

import re
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence

from robochoc.formats.costs import scale_text
from robochoc.formats.definitions import MAX_VALUES, PREDEFINED
from robochoc.formats.diagnostics import Diagnostic, MistakeError, shortened, suggestion
from robochoc.formats.names import check_word
from robochoc.formats.team_members import TeamMembers
from robochoc.model.problem import Constraint, Definition, Domain, Relation, Robot
from robochoc.model.symbols import EITHER

INTEGER, SYMBOL = "an integer", "a symbol"
"""Kinds of values, in words. Real numbers have the kinds `real_kind`."""
MAX_SYMBOL = 100
"""The maximum length of a symbol's name."""

_SYMBOL = re.compile(rf"[^\s|:'\"<>&]{{1,{MAX_SYMBOL}}}")
_NUMBER = re.compile(r"[-+.0-9]+")


class SymbolTable:
    """The symbols in a team's files, in the order of their first use. The index of a symbol is its code.

    Attributes:
        parts: The domains and definitions read so far, by their text: equal texts in several files become one object.
    """

    def __init__(self, known: Sequence[str] = ()) -> None:
        """Start with the symbols `known`. Their codes are their indices."""
        self._codes = {name: code for code, name in enumerate(known)}
        self._declared: set[str] = set()
        self._mentioned: dict[str, tuple[str, int]] = {}
        self.parts: dict[Hashable, Domain | Definition] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """All symbols so far, in the order of their codes."""
        return tuple(self._codes)

    def declare(self, word: str) -> int:
        """Return the code of a symbol in a domain. Raises `MistakeError`."""
        code = self._code(word)
        self._declared.add(word)
        return code

    def mention(self, word: str, file: str, line: int) -> int:
        """Return the code of a symbol used outside a domain, in that `line` of a file. Raises `MistakeError`."""
        code = self._code(word)
        self._mentioned.setdefault(word, (file, line))
        return code

    def undeclared(self) -> Iterator[Diagnostic]:
        """Yield the symbols that do not occur in any domain of any file."""
        for word, (file, line) in self._mentioned.items():
            if word not in self._declared:
                hint = suggestion(word, sorted(self._declared), "symbols")
                yield Diagnostic(file, line, f"no domain of the team has the symbol '{shortened(word)}'", hint)

    def _code(self, word: str) -> int:
        code = self._codes.get(word)
        if code is None:
            check_symbol(word)
            if len(self._codes) == MAX_VALUES:
                raise MistakeError(f"more than {MAX_VALUES} symbols", "use fewer")
            code = self._codes[word] = len(self._codes)
        return code


def check_symbol(word: str) -> None:
    """Raise `MistakeError` unless `word` is a valid symbol."""
    if not _SYMBOL.fullmatch(word) or _NUMBER.fullmatch(word):
        hint = f"expected a name of at most {MAX_SYMBOL} characters: no number, no blank, none of | : ' \" < > &"
        raise MistakeError(f"'{shortened(word)}' cannot be a symbol", hint)
    check_word(word)


def check_symbolic_domain(domain: Domain) -> None:
    """Raise `MistakeError` unless the values of a symbolic domain are codes of its symbols."""
    check_table(domain.symbols)
    for part in domain.ranges:
        if part.start < 0 or part.stop > len(domain.symbols):
            wrong = part.start if part.start < 0 else part.stop - 1
            message = f"the value {wrong} of domain {shortened(domain.name)} is not the code of a symbol"
            raise MistakeError(message, f"use codes from 0 to {len(domain.symbols) - 1}")


def check_table(names: Sequence[str]) -> None:
    """Raise `MistakeError` unless `names` are valid symbols of a team."""
    if len(names) > MAX_VALUES:
        raise MistakeError(f"more than {MAX_VALUES} symbols", "use fewer")
    for word in names:
        check_symbol(word)
    if len(set(names)) < len(names):
        raise MistakeError("a symbol occurs twice in the table of symbols", "list each symbol once")


def check_one_table(robot: Robot) -> None:
    """Raise `MistakeError` unless all symbolic domains of a robot have the same valid table of symbols."""
    tables = [one.domain.symbols for one in robot.variables if one.domain.symbols]
    tables += [robot.symbols] if robot.symbols else []
    if any(table != tables[0] for table in tables[1:]):
        raise MistakeError("its symbolic domains have different tables of symbols", _ONE_TABLE)
    check_table(robot.symbols)


def check_symbolic_definition(definition: Definition, table: Sequence[str]) -> None:
    """Raise `MistakeError` unless a definition's symbolic parameters or columns exist, and codes are in `table`."""
    if not isinstance(definition, Relation):
        unknown = [name for name in definition.symbolic if name not in definition.parameters]
        if unknown:
            message = f"`symbolic` contains '{shortened(unknown[0])}', which is not a parameter"
            raise MistakeError(message, "list names of parameters")
        return
    for column in definition.symbolic:
        if not 0 <= column < definition.arity:
            message = f"`symbolic` contains the column {column}, which does not exist"
            raise MistakeError(message, f"use numbers from 0 to {definition.arity - 1}")
        for values in definition.tuples:
            if not 0 <= values[column] < len(table):
                message = f"the value {values[column]} in column {column} is not the code of a symbol"
                raise MistakeError(message, "use an index of `Robot.symbols`")


def kind_of(domain: Domain) -> str:
    """Return the kind of values in a domain, in words: `INTEGER`, `SYMBOL`, or a real number with its precision."""
    return real_kind(domain.real.places) if domain.real else SYMBOL if domain.symbols else INTEGER


def real_kind(places: int) -> str:
    """Return the kind of real numbers with `places` decimal places, in words."""
    return f"a real number with the precision {scale_text(places)}"


def check_argument_types(constraint: Constraint, known: Mapping[str, str]) -> None:
    """Raise `MistakeError` if an argument of a constraint is of another kind than its parameter.

    Args:
        constraint: The constraint.
        known: For each known variable, the kind of its values.
    """
    kinds = _kinds(constraint.definition)
    if len(kinds) != len(constraint.parameters):
        return  # another mistake
    given = [INTEGER if isinstance(term, int) else known.get(term) for term in constraint.parameters]
    if {*given, *kinds} <= {INTEGER, None}:
        return
    for term, wanted, kind in zip(constraint.parameters, kinds, given, strict=True):
        if None not in {wanted, kind} and wanted != kind:
            name = shortened(constraint.definition.name)
            raise MistakeError(f"{name} expects {wanted}, but '{term}' is {kind}", _hint(str(wanted), str(kind)))
    if isinstance(constraint.definition, Relation):
        return  # a column in a relation without tuples fits any domain
    loose = {
        kind: term
        for term, wanted, kind in zip(constraint.parameters, kinds, given, strict=True)
        if wanted is None and kind is not None
    }
    if SYMBOL in loose and constraint.definition.name not in EITHER:
        message = f"{constraint.definition.name} expects {INTEGER}, but '{loose[SYMBOL]}' is {SYMBOL}"
        raise MistakeError(message, _hint(INTEGER, SYMBOL))
    if len(loose) > 1:
        kind, other = sorted(loose, key=lambda one: (one != SYMBOL, one == INTEGER))[:2]
        hint = "use a predicate with parameters real X int Y"
        if kind == SYMBOL:
            hint = "compare symbols with symbols; in an expression, quote a symbol: eq(X, 'red')"
        raise MistakeError(f"'{loose[kind]}' is {kind}, but '{loose[other]}' is {other}", hint)


def _hint(wanted: str, given: str) -> str:
    """Return the correction for an argument of another kind."""
    if INTEGER in {wanted, given} and SYMBOL in {wanted, given}:
        return "write symbol X or int X among its parameters, like the argument"
    if wanted not in {INTEGER, SYMBOL} and given not in {INTEGER, SYMBOL}:
        return "use one precision in all files of the team"
    return "write real X or int X among its parameters of a predicate or function, like the argument"


def mistyped_constraints(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield constraints whose arguments among another robot's variables are of another kind than the parameters."""
    known = kinds_by_variable(members.robots)
    if {*known.values()} <= {INTEGER} and not any(robot.symbol_table for robot in members.robots):
        return
    for robot in members.robots:
        parts = [part for child in robot.children for part in (*child.constraints, *child.copies)]
        for constraint in (*robot.shared, *parts):
            try:
                check_argument_types(constraint, known)
            except MistakeError as mistake:
                place = members.files[robot.name].places.constraint(constraint)
                yield place.mistake(mistake.message, mistake.hint)


def different_tables(members: TeamMembers) -> Iterator[Diagnostic]:
    """Yield robots built in Python whose symbols have other codes than in the first robot with symbols."""
    first: Robot | None = None
    for robot in members.robots:
        if robot.symbol_table:
            first = first or robot
            if robot.symbol_table != first.symbol_table:
                message = f"its symbols differ from those of '{first.name}'"
                yield members.place(robot.name).mistake(message, _ONE_TABLE)


def kinds_by_variable(robots: Iterable[Robot]) -> dict[str, str]:
    """Return for each variable of `robots` the kind of its values."""
    return {one.name: kind_of(one.domain) for robot in robots for one in robot.variables}


_ONE_TABLE = "use one table in all domains of a team; the ranges of a domain select its symbols"


def _kinds(definition: Definition) -> list[str | None]:
    """Return the kind of each parameter; None if several kinds are possible."""
    if isinstance(definition, Relation):
        known = bool(definition.tuples or definition.symbolic)
        return [
            (SYMBOL if place in definition.symbolic else INTEGER) if known else None
            for place in range(definition.arity)
        ]
    if PREDEFINED.get(definition.name) == definition:
        return [None, None]
    kinds: dict[str, str | None] = dict.fromkeys(definition.parameters, INTEGER)
    kinds |= dict.fromkeys(definition.symbolic, SYMBOL)
    if definition.real:
        kinds |= dict.fromkeys(definition.real.names, real_kind(definition.real.places))
    return [*kinds.values()]


def codes_of(words: Collection[str], table: SymbolTable) -> list[int]:
    """Return the codes of the symbols in a domain, in ascending order. Raises `MistakeError`."""
    codes: set[int] = set()
    for word in words:
        code = table.declare(word)
        if code in codes:
            raise MistakeError(f"the symbol '{shortened(word)}' occurs twice in the domain", "list it once")
        codes.add(code)
    return sorted(codes)
