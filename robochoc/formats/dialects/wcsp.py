"""toulbar2's `.wcsp`: a sequence of numbers (toulbar2's documentation, "wcsp format")."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from robochoc.formats.definitions import MAX_TUPLES, MAX_VALUES
from robochoc.formats.diagnostics import shortened
from robochoc.formats.dialects.dialect import (
    ConversionNote,
    Dialect,
    ExportOptions,
    ExportResult,
    ImportOptions,
    ImportResult,
)
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable
from robochoc.formats.dialects.tabulation import amounts, is_maximised
from robochoc.formats.dialects.toulbar2.network import CostFunction, CostFunctionNetwork, TeamCosts, team_costs, to_team
from robochoc.formats.dialects.toulbar2.word_reader import WordReader, Words, has_suffix, read_file, read_words
from robochoc.model.constraint import INFINITE
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

MAX_VARIABLES = 1_000_000
"""The maximum number of variables and of cost functions."""


def recognises(path: Path, beginning: bytes) -> bool:
    """Return whether a file is toulbar2's, by its name."""
    return has_suffix(path, ".wcsp") and bool(beginning)


def read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    """Return the problem in a file. Raises `InvalidInputError`."""
    return read_file(paths, options, _read_text)


def _read_text(text: str, stem: str, options: ImportOptions) -> ImportResult:
    """Return the problem in the `text` of a file. Raises `MistakeError`."""
    network = read_words(_words(text), lambda source: _WcspReader(source, stem).network())
    return to_team(network, options, "wcsp")


def _words(text: str) -> Words:
    for number, line in enumerate(text.split("\n"), 1):
        for word in line.split():
            yield number, word


class _WcspReader:
    def __init__(self, reader: WordReader, stem: str) -> None:
        self._in = reader
        self._stem = stem
        self._sizes: list[int] = []
        self._shared: list[ExactCostTable] = []

    def network(self) -> CostFunctionNetwork:
        """Return the network in the file. Raises `MistakeError`."""
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", self._in.word("the name"))[:100].strip("._-")
        count = self._count("the number of variables")
        self._in.integer("the maximum size of a domain")
        functions = self._count("the number of cost functions")
        bound = self._in.integer("the upper bound")
        if count < 1:
            self._in.refuse("there are no variables", "write at least one variable")
        for _ in range(count):
            size = abs(self._in.integer("the size of a domain"))
            if not 0 < size <= MAX_VALUES:
                self._in.refuse(f"the domain has {size} values", f"use from 1 to {MAX_VALUES} values")
            self._sizes.append(size)
        found: list[CostFunction] = []
        notes: tuple[ConversionNote, ...] = ()
        for number in range(functions):
            word = self._in.more()
            if word is None:
                text = f"the file declares {functions} cost functions, but has {number}"
                notes = (ConversionNote("count", text),)
                break
            found.append(self._function(self._in.as_integer(word, "the arity of a function"), number))
        variables: dict[str, int | tuple[str, ...]] = {f"x{place}": size for place, size in enumerate(self._sizes)}
        return CostFunctionNetwork(name or self._stem, variables, found, bound, notes=notes)

    def _count(self, what: str) -> int:
        number = self._in.integer(what)
        if not 0 <= number <= MAX_VARIABLES:
            self._in.refuse(f"{what} is {number}", f"use a number from 0 to {MAX_VARIABLES}")
        return number

    def _function(self, arity: int, number: int) -> CostFunction:
        line, shared = self._in.line, arity < 0
        scope = tuple(self._place() for _ in range(min(abs(arity), len(self._sizes) + 1)))
        if len(set(scope)) < abs(arity):
            what = f"the scope '{shortened(' '.join(map(str, scope)))}' contains a variable twice"
            self._in.refuse(what, "name each variable once")
        default = self._in.integer("a default cost")
        if default == -1:
            name = self._in.word("the name of a function")
            what = f"the named cost function '{shortened(name)}' is not supported"
            self._in.refuse(what, "write it as a table of costs")
        table = self._table(f"f{number}", scope, default)
        if shared:
            self._shared.append(table)
        return CostFunction(scope, table, line)

    def _table(self, name: str, scope: tuple[int, ...], default: int) -> ExactCostTable:
        size = math.prod(self._sizes[place] for place in scope)
        count = self._in.integer("the number of tuples")
        if count < 0:
            if -count > len(self._shared):
                what = f"the tuples are those of the shared function {-count}, which is not defined above"
                self._in.refuse(what, "write the number of a shared function above, from 1")
            table = self._shared[-count - 1]
            if table.size != size or {len(values) for values in table.rows} - {len(scope)}:
                what = f"the tuples are those of the shared function {-count}, which has different domains"
                self._in.refuse(what, "write the tuples")
            return replace(table, name=name)
        if count > MAX_TUPLES:
            self._in.refuse(f"the function has {count} tuples", f"use at most {MAX_TUPLES} tuples")
        rows: dict[tuple[int, ...], Amount] = {}
        for _ in range(count):
            values = tuple([self._value(place) for place in scope])
            cost = self._cost(self._in.integer("a cost"))
            if rows.setdefault(values, cost) != cost:
                what = f"the tuple {' '.join(map(str, values))} has two different costs"
                self._in.refuse(what, "delete one of them")
        return ExactCostTable(name, rows, self._cost(default), size)

    def _place(self) -> int:
        place = self._in.integer("a variable")
        if not 0 <= place < len(self._sizes):
            what = f"there is no variable {place}"
            self._in.refuse(what, f"write the index of a variable, from 0 to {len(self._sizes) - 1}")
        return place

    def _value(self, place: int) -> int:
        value = self._in.integer("a value")
        if not 0 <= value < self._sizes[place]:
            what = f"the variable {place} has no value {value}"
            self._in.refuse(what, f"write a value from 0 to {self._sizes[place] - 1}")
        return value

    def _cost(self, cost: int) -> int:
        if cost < 0:
            self._in.refuse(f"the cost {cost} is negative", "write costs of 0 or more")
        return cost


def write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the `.wcsp` file of `team`, which contains no names.

    Raises:
        UnsupportedError: if a cost is negative or not an integer, costs are maximised, costs or the table of a
            constraint are too large, or the team changes over time.
    """
    del options
    network = team_costs(team)
    costs = {network.constant, *amounts(network.tables)}
    if is_maximised(team) or any(cost < 0 or (cost != INFINITE and Fraction(cost) % 1) for cost in costs):
        raise UnsupportedError("a wcsp has only integer costs of 0 or more, minimised: use --format cfn for this team")
    return ExportResult({f"{team.name}.wcsp": ("\n".join(_wcsp(team, network)) + "\n").encode()})


def _wcsp(team: Team, network: TeamCosts) -> Iterator[str]:
    tables, constant, _, bound = network
    place = {name: number for number, name in enumerate(team.variables)}
    codes = {
        name: {value: code for code, value in enumerate(variable.domain)} for name, variable in team.variables.items()
    }
    sizes = [len(variable.domain) for variable in team.variables.values()]
    yield f"{team.name} {len(sizes)} {max(sizes)} {len(tables) + (1 if constant else 0)} {bound}"
    yield " ".join(map(str, sizes))
    if constant:
        yield f"0 {constant} 0"
    for one in tables:
        scope = " ".join(str(place[name]) for name in one.scope)
        yield f"{len(one.scope)} {scope} {_cost_number(one.table.default, bound)} {len(one.table.rows)}"
        for values, cost in one.table.rows.items():
            coded = " ".join(str(codes[name][value]) for name, value in zip(one.scope, values, strict=True))
            yield f"{coded} {_cost_number(cost, bound)}"


def _cost_number(cost: Amount, bound: int) -> int:
    return bound if cost == INFINITE else int(cost)


DIALECT = Dialect("wcsp", "toulbar2's wcsp", recognises, read, write)
