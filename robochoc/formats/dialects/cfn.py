"""toulbar2's `.cfn`: a relaxed form of JSON (toulbar2's documentation, "CFN format").

Quotes, commas and colons are only separators; braces and brackets are equivalent; without tags the order of the parts
determines their meaning.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from robochoc.formats.definitions import MAX_TUPLES, MAX_VALUES
from robochoc.formats.diagnostics import shortened, suggestion
from robochoc.formats.dialects.dialect import (
    ConversionNote,
    Dialect,
    ExportOptions,
    ExportResult,
    ImportOptions,
    ImportResult,
)
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable
from robochoc.formats.dialects.tabulation import decimal, is_maximised
from robochoc.formats.dialects.toulbar2.network import CostFunction, CostFunctionNetwork, TeamCosts, team_costs, to_team
from robochoc.formats.dialects.toulbar2.word_reader import WordReader, Words, has_suffix, read_file, read_words
from robochoc.model.constraint import INFINITE, Domain
from robochoc.model.problem import Team
from robochoc.system.plain_text import counted

_TOKEN = re.compile(r'[{}\[\]]|[^{}\[\]\s":,]+')


def recognises(path: Path, beginning: bytes) -> bool:
    """Return whether a file is toulbar2's, by its name and its first character."""
    return has_suffix(path, ".cfn") and beginning.lstrip()[:1] in (b"{", b"[", b"#", b"\x1f", b"\xfd")


def read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    """Return the problem in a file. Raises `InvalidInputError`."""
    return read_file(paths, options, _read_text)


def _read_text(text: str, stem: str, options: ImportOptions) -> ImportResult:
    """Return the problem in the `text` of a file. Raises `MistakeError`."""
    network = read_words(_words(text), lambda source: _CfnReader(source, stem).network())
    return to_team(network, options, "cfn")


def _words(text: str) -> Words:
    for number, line in enumerate(text.split("\n"), 1):
        if not line.startswith("#"):
            for match in _TOKEN.finditer(line.split("//", 1)[0]):
                yield number, match[0]


class _CfnReader:
    def __init__(self, reader: WordReader, stem: str) -> None:
        self._in = reader
        self._stem = stem
        self._tagged = False
        self._variables: dict[str, int | tuple[str, ...]] = {}
        self._names: list[str] = []
        self._known: dict[str, int] = {}
        self._tables: dict[str, ExactCostTable] = {}
        self._functions: list[CostFunction] = []
        self._shared: list[tuple[int, str]] = []
        self._places = 0
        self._truncated = False

    def network(self) -> CostFunctionNetwork:
        """Return the network in the file. Raises `MistakeError`."""
        name, bound, maximize = self._header()
        self._read_variables()
        self._tag("functions")
        self._open("the functions")
        while not _closes(word := self._in.word("a function, or '}'")):
            self._read_function(word)
        if (last := self._in.more()) is not None and not _closes(last):  # toulbar2 allows a missing last bracket
            self._in.refuse(f"expected the end of the problem, found '{shortened(last)}'", "write } or ]")
        for place, source in self._shared:
            self._functions[place] = self._with_shared_costs(self._functions[place], source)
        notes: tuple[ConversionNote, ...] = ()
        if self._truncated:
            text = f"costs are cut to {counted(self._places, 'decimal place')}, those of mustbe, as toulbar2 does"
            notes = (ConversionNote("truncated", text),)
        return CostFunctionNetwork(_title(name, self._stem), self._variables, self._functions, bound, maximize, notes)

    def _header(self) -> tuple[str, Amount, bool]:
        self._open("the problem")
        word = self._in.word("'problem'")
        if word == "problem":
            self._tagged = True
            word = self._in.word("'{'")
        if not _opens(word):
            self._in.refuse(f"expected '{{', found '{shortened(word)}'", 'write { "problem": { "name": ...')
        self._tag("name")
        name = self._in.word("the problem's name")
        self._tag("mustbe")
        word = self._in.word("the bound")
        if word[0] not in "<>" or word[1:] == "inf":
            what = f"the bound '{shortened(word)}' is not valid"
            self._in.refuse(what, "write <100.00 to minimise, or >-100.00 to maximise")
        self._places = len(word.partition(".")[2])
        bound = self._in.amount(word[1:])
        self._close("the problem")
        return name, bound, word[0] == ">"

    def _read_variables(self) -> None:
        self._tag("variables")
        self._open("the variables")
        while not _closes(word := self._in.word("a variable")):
            if _opens(word) or word[0].isdigit() or word[0] == "-":
                name = f"x{len(self._names)}"
            else:
                name, word = word, self._in.word("a domain")
            if name in self._variables:
                self._in.refuse(f"duplicate variable '{shortened(name)}'", "rename one of them")
            self._variables[name] = self._domain(word)
            self._known[name] = len(self._names)
            self._names.append(name)
        if not self._names:
            self._in.refuse("there are no variables", 'write "variables": {"x": 2}')

    def _domain(self, word: str) -> int | tuple[str, ...]:
        if not _opens(word):
            size = abs(self._in.as_integer(word, "a domain or its size"))
            if not 0 < size <= MAX_VALUES:
                self._in.refuse(f"the domain has {size} values", f"use from 1 to {MAX_VALUES} values")
            return size
        values: dict[str, None] = {}
        while not _closes(one := self._in.word("a value")):
            if one in values or _opens(one):
                self._in.refuse(f"expected a new value, found '{shortened(one)}'", "write each value once")
            values[one] = None
        if not values:
            self._in.refuse("the domain has no values", "write [a b c], or the number of values")
        return tuple(values)

    def _read_function(self, word: str) -> None:
        name = f"f{len(self._functions)}"
        if not _opens(word):
            name = word
            self._open(f"the function {shortened(name)}")
        line = self._in.line
        self._tag("scope")
        scope = self._scope()
        default, word = self._default()
        sized = math.prod(self._size(place) for place in scope)
        if self._tagged and word == "type":
            self._refuse_type(self._in.word("a type"))
        if self._tagged:
            if word != "costs":
                self._in.refuse(f"expected 'costs', found '{shortened(word)}'", 'write "costs": [...]')
            word = self._in.word("costs")
        if _opens(word):
            rows = self._dense(scope, sized) if default is None else self._sparse(scope)
            table = ExactCostTable(name, rows, default or 0, sized)
        else:
            self._shared.append((len(self._functions), word))
            table = ExactCostTable(name, {}, 0, sized)
        self._functions.append(CostFunction(scope, table, line))
        self._tables.setdefault(name, table)
        closing = self._in.word("'}'")
        if _opens(closing) and not self._tagged:
            self._refuse_type(word)
        if not _closes(closing):
            self._in.refuse(f"expected the end of the function, found '{shortened(closing)}'", "write } or ]")

    def _default(self) -> tuple[Amount | None, str]:
        """Return the default cost, or None, and the next word."""
        word = self._in.word("costs")
        if self._tagged and word == "defaultcost":
            return self._cost(self._in.word("a cost")), self._in.word("'costs'")
        if not self._tagged and (word[0] in "0123456789-+." or word == "inf"):
            return self._cost(word), self._in.word("costs")
        return None, word

    def _scope(self) -> tuple[int, ...]:
        self._open("the scope")
        scope: list[int] = []
        while not _closes(word := self._in.word("a variable")):
            counted = word[0].isdigit()
            place = self._in.as_integer(word, "a variable") if counted else self._known.get(word, -1)
            if not 0 <= place < len(self._names):
                self._in.refuse(
                    f"the scope contains '{shortened(word)}', which is not a variable",
                    suggestion(word, self._names, "variables"),
                )
            if place in scope:
                self._in.refuse(f"the scope contains '{shortened(word)}' twice", "name each variable once")
            scope.append(place)
        return tuple(scope)

    def _dense(self, scope: Sequence[int], size: int) -> dict[tuple[int, ...], Amount]:
        """Return the costs of all tuples, listed in lexicographic order of the tuples."""
        if size > MAX_TUPLES:
            self._in.refuse(f"the function has {size} tuples", f"use at most {MAX_TUPLES} tuples")
        rows: dict[tuple[int, ...], Amount] = {}
        for values in itertools.product(*[range(self._size(place)) for place in scope]):
            word = self._in.word("a cost")
            if _closes(word):
                self._in.refuse(f"the function has {len(rows)} costs instead of {size}", "write one for each tuple")
            rows[values] = self._cost(word)
        if not _closes(self._in.word("']'")):
            self._in.refuse(f"the function has more than {size} costs", "write one for each tuple")
        return rows

    def _sparse(self, scope: Sequence[int]) -> dict[tuple[int, ...], Amount]:
        rows: dict[tuple[int, ...], Amount] = {}
        while not _closes(word := self._in.word("a tuple")):
            if not scope:
                self._in.refuse("a constant has a default cost and another cost", "write one cost")
            values = [self._value(scope[0], word)]
            values += [self._value(place, self._in.word("a value")) for place in scope[1:]]
            cost = self._cost(self._in.word("a cost"))
            if rows.setdefault(tuple(values), cost) != cost:
                self._in.refuse("a tuple has two different costs", "delete one of them")
            if len(rows) > MAX_TUPLES:
                self._in.refuse(f"the function has more than {MAX_TUPLES} tuples", "use smaller domains or scopes")
        return rows

    def _value(self, place: int, word: str) -> int:
        domain = self._variables[self._names[place]]
        if word[0].isdigit():
            number = self._in.as_integer(word, "a value")
        elif isinstance(domain, int):
            number = int(word[1:]) if re.fullmatch(r"v[0-9]{1,9}", word) else -1
        else:
            number = domain.index(word) if word in domain else -1
        if not 0 <= number < self._size(place):
            what = f"the variable {shortened(self._names[place])} has no value '{shortened(word)}'"
            self._in.refuse(what, "write the name of a value, or its index from 0")
        return number

    def _size(self, place: int) -> int:
        domain = self._variables[self._names[place]]
        return domain if isinstance(domain, int) else len(domain)

    def _cost(self, word: str) -> Amount:
        """Return a cost, truncated to the decimal places of `mustbe`."""
        amount = self._in.amount(word)
        if not isinstance(amount, Fraction) or amount == INFINITE:
            return amount
        cut = Fraction(math.trunc(amount * 10**self._places), 10**self._places)
        self._truncated |= cut != amount
        return cut

    def _with_shared_costs(self, function: CostFunction, source: str) -> CostFunction:
        self._in.line = function.line
        table = self._tables.get(source)
        if table is None:
            what = f"the costs are those of '{shortened(source)}', which is not a function"
            self._in.refuse(what, "write the name of a function, or costs: [...]")
        if table.size != function.table.size or {len(values) for values in table.rows} - {len(function.scope)}:
            what = f"the costs are those of '{shortened(source)}', which has different domains"
            self._in.refuse(what, "write costs: [...]")
        return replace(function, table=replace(table, name=function.table.name))

    def _refuse_type(self, name: str) -> Iterator[None]:
        what = f"the global cost function '{shortened(name)}' is not supported"
        self._in.refuse(what, "write it as a table of costs")

    def _tag(self, expected: str) -> None:
        if self._tagged and (word := self._in.word(f"'{expected}'")) != expected:
            what = f"expected '{expected}', found '{shortened(word)}'"
            self._in.refuse(what, "write the tags in the order of the CFN format")

    def _open(self, what: str) -> None:
        if not _opens(word := self._in.word("'{'")):
            self._in.refuse(f"expected the beginning of {what}, found '{shortened(word)}'", "write { or [")

    def _close(self, what: str) -> None:
        if not _closes(word := self._in.word("'}'")):
            self._in.refuse(f"expected the end of {what}, found '{shortened(word)}'", "write } or ]")


def _title(name: str, stem: str) -> str:
    return re.sub(r"[^A-Za-z0-9_.-]+", "_", name)[:100].strip("._-") or stem


def _opens(word: str) -> bool:
    return word in ("{", "[")


def _closes(word: str) -> bool:
    return word in ("}", "]")


def write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the `.cfn` file of `team`, with a bound that exceeds every sum of finite costs.

    Forbidden tuples cost three times the bound, since toulbar2 1.1 does not read `inf`: a sum with such a cost reaches
    the bound even with the least cost of all other functions.

    Raises:
        UnsupportedError: if costs or a constraint's table are too large, or the team changes over time.
    """
    del options
    return ExportResult({f"{team.name}.cfn": ("\n".join(_cfn(team, team_costs(team))) + "\n").encode()})


def _cfn(team: Team, network: TeamCosts) -> Iterator[str]:
    tables, constant, places, bound = network
    sign = -1 if is_maximised(team) else 1
    mustbe = f"{'>' if sign < 0 else '<'}{decimal(sign * bound, places)}"
    forbidden_cost = decimal(sign * 3 * bound, places)
    names = {name: _names(variable.domain) for name, variable in team.variables.items()}
    yield "{"
    yield f'  "problem": {{"name": "{team.name}", "mustbe": "{mustbe}"}},'
    yield '  "variables": {'
    yield ",\n".join(f'    "{name}": {_cfn_domain(team.variables[name].domain, names[name])}' for name in names)
    yield "  },"
    yield '  "functions": {'
    functions = [f'    "constant": {{"scope": [], "costs": [{decimal(constant, places)}]}}'] if constant else []
    for number, one in enumerate(tables):
        scope = ", ".join(f'"{name}"' for name in one.scope)
        costs = ", ".join(
            ", ".join([*(f'"{names[name][value]}"' for name, value in zip(one.scope, values, strict=True)), cost_word])
            for values, cost_word in (
                (values, _cost(cost, places, forbidden_cost)) for values, cost in one.table.rows.items()
            )
        )
        default = _cost(one.table.default, places, forbidden_cost)
        functions.append(f'    "f{number}": {{"scope": [{scope}], "defaultcost": {default}, "costs": [{costs}]}}')
    yield ",\n".join(functions)
    yield "  }"
    yield "}"


def _cost(cost: Amount, places: int, forbidden_cost: str) -> str:
    return forbidden_cost if cost == INFINITE else decimal(cost, places)


def _is_zero_based(domain: Domain) -> bool:
    """Return whether the values are 0, 1, ... Such values need no names."""
    return not domain.symbols and len(domain.ranges) == 1 and domain.ranges[0].start == 0


def _names(domain: Domain) -> dict[int, str]:
    """Return the names of the values. Each name begins with a letter or an underscore."""
    if _is_zero_based(domain):
        return {value: str(value) for value in domain}
    names = {}
    for value in domain:
        label = str(domain.label(value)) if domain.symbols else f"{'m' if value < 0 else 'v'}{abs(value)}"
        plain = "".join(sign if sign.isalnum() or sign in "_.-" else "_" for sign in label)
        names[value] = plain if plain[0].isalpha() or plain[0] == "_" else f"v{plain}"
    if len(set(names.values())) < len(names):
        names = {value: f"{name}_{number}" for number, (value, name) in enumerate(names.items())}
    return names


def _cfn_domain(domain: Domain, names: Mapping[int, str]) -> str:
    if _is_zero_based(domain):
        return str(len(domain))
    return f"[{', '.join(f'{chr(34)}{name}{chr(34)}' for name in names.values())}]"


DIALECT = Dialect("cfn", "toulbar2's cfn", recognises, read, write)
