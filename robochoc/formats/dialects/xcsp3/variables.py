"""The variables of an XCSP3 instance: single ones, arrays, their domains, and compact lists such as `x[][1..2]`."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.xcsp3.document import ignore_remarks
from robochoc.formats.dialects.xcsp3.expressions import integer, span, words_of
from robochoc.formats.element_view import ElementView
from robochoc.model.constraint import merge_ranges
from robochoc.model.problem import Domain
from robochoc.system.lazy_dataclass import dataclass

MAX_VARIABLES = 100_000
"""The maximum number of variables, and of variables in one list."""

_ID = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SYMBOL = re.compile(r"[A-Za-z_][^(){},*%|:<>&\"']*")
_SIZE = re.compile(r"(?:\[[0-9]{1,9}\])+")
_COMPACT = re.compile(r"([A-Za-z][A-Za-z0-9_]*)((?:\[[0-9.]*\])+)")
_BRACKETS = re.compile(r"\[([0-9.]*)\]")
_MANY_TIMES = re.compile(r"([+-]?[0-9]{1,18})x([0-9]{1,9})")

Values = tuple[range, ...] | tuple[str, ...]
"""A domain as in the file: ranges of integers, or symbols."""
_Domains = Mapping[str, Values]
"""The domains of a variable or an array, by the text of the attribute `for`; an empty text means all variables."""


@dataclass
class Variables:
    """All variables of an instance.

    Attributes:
        domains: Their domains by id, in the order of their declarations.
        shapes: The sizes of arrays, by id.
    """

    domains: dict[str, Values] = field(default_factory=dict)
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def symbols(self) -> tuple[str, ...]:
        """All symbols, in the order of their first occurrence."""
        all_symbols = (symbol for domain in self.domains.values() for symbol in domain if isinstance(symbol, str))
        return tuple(dict.fromkeys(all_symbols))

    def is_symbolic(self, name: str) -> bool:
        """Return whether the values of a variable are symbols."""
        return isinstance(self.domains[name][0], str)

    def expand(self, words: str) -> Iterator[str]:
        """Yield the words of a list with compact forms expanded: `x[]` to its variables, `2x3` to `2 2 2`.

        Raises:
            MistakeError: if there is no such variable, or the list is too long.
        """
        number = 0
        for word in words_of(words):
            for one in self._expand_word(word):
                number += 1
                if number > MAX_VARIABLES:
                    raise MistakeError(f"a list has more than {MAX_VARIABLES:,} members", "split it")
                yield one

    def matrix(self, text: str) -> list[list[str]]:
        """Return the rows of a matrix: `(x,y)(1,2)`, or `x[][]`. Raises `MistakeError`."""
        if text.startswith("("):
            return [[one for word in row for one in self._expand_word(word.strip())] for row in lists(text)]
        match = _COMPACT.fullmatch(text)
        if not match or match[1] not in self.shapes:
            raise MistakeError(f"'{shortened(text)}' is not a valid matrix", "write x[][] or (x,y)(z,u)")
        indexes = self._indexes(match[1], match[2])
        wide = [place for place, values in enumerate(indexes) if len(values) != 1]
        if len(wide) != 2:  # noqa: PLR2004 - rows and columns
            raise MistakeError(f"'{shortened(text)}' is not a valid matrix", "write two open indexes, such as x[][]")
        row, column = wide
        found = []
        for one in indexes[row]:
            chosen = list(indexes)
            chosen[row] = range(one, one + 1)
            found.append(self._cells(match[1], chosen))
            if len(indexes[column]) != len(found[-1]):
                raise MistakeError(f"'{shortened(text)}' has cells without a domain", "name its variables one by one")
        return found

    def add(self, name: str, domain: Values) -> None:
        """Declare a variable. Raises `MistakeError`."""
        if name in self.domains:
            raise MistakeError(f"duplicate variable '{shortened(name)}'", "change the id of one of them")
        if len(self.domains) == MAX_VARIABLES:
            raise MistakeError(f"there are more than {MAX_VARIABLES:,} variables", "import a smaller problem")
        self.domains[name] = domain

    def add_array(self, name: str, shape: tuple[int, ...], domains: Sequence[tuple[str, Values]]) -> None:
        """Declare the variables of an array.

        Args:
            name: The id of the array.
            shape: Its sizes.
            domains: The domains, each with the text of its attribute `for`.

        Raises:
            MistakeError: if the array is too large, or a domain is invalid.
        """
        if math.prod(shape) > MAX_VARIABLES:
            what = f"the array {name} has {math.prod(shape):,} variables"
            raise MistakeError(what, f"use at most {MAX_VARIABLES:,} variables")
        self.shapes[name] = shape
        cells = self._cells(name, [range(size) for size in shape], declared=False)
        known: dict[str, Values] = {}
        for words, domain in domains:
            if words == "others":
                known.update((cell, domain) for cell in cells if cell not in known)
                continue
            for word in words.split():
                match = _COMPACT.fullmatch(word)
                if not match or match[1] != name:
                    raise MistakeError(f"'{shortened(word)}' is not in the array {name}", 'write for="x[0][] x[1][2]"')
                for cell in self._cells(name, self._indexes(name, match[2]), declared=False):
                    if known.setdefault(cell, domain) is not domain:
                        raise MistakeError(f"{cell} has two domains", "delete one of them")
        for cell in cells:
            if cell in known:
                self.add(cell, known[cell])

    def _expand_word(self, word: str) -> Iterable[str]:
        if word in self.domains:
            return (word,)
        match = _COMPACT.fullmatch(word)
        if match and match[1] in self.shapes:
            cells = self._cells(match[1], self._indexes(match[1], match[2]))
            if not cells:
                raise MistakeError(f"{shortened(word)} has no domain", f"name variables of {match[1]} that have one")
            return cells
        many = _MANY_TIMES.fullmatch(word)
        if many:
            return itertools.repeat(many[1], int(many[2]))
        return (word,)

    def _indexes(self, name: str, brackets: str) -> list[range]:
        shape, written = self.shapes[name], _BRACKETS.findall(brackets)
        found = [span(part) if part else range(size) for part, size in zip(written, shape, strict=False)]
        if len(written) != len(shape) or any(part.stop > size for part, size in zip(found, shape, strict=False)):
            what = f"{name}{shortened(brackets)} is not in the array {name}"
            raise MistakeError(what, f"write indexes within its sizes {shape}")
        return found

    def _cells(self, name: str, indexes: Sequence[range], *, declared: bool = True) -> list[str]:
        cells = (name + "".join(f"[{index}]" for index in place) for place in itertools.product(*indexes))
        return [cell for cell in cells if not declared or cell in self.domains]


def lists(text: str) -> list[list[str]]:
    """Return the words of each list in `(1,2)(3,4)`. Raises `MistakeError`."""
    text = text.strip()
    if not text.startswith("(") or not text.endswith(")"):
        raise MistakeError(f"'{shortened(text)}' is not a sequence of lists in parentheses", "write (1,2)(3,4)")
    return [row.split(",") for row in re.split(r"\)\s*\(", text[1:-1])]


def read_variables(view: ElementView | None) -> Variables:
    """Return the variables declared in `<variables>`; mistakes are added to the report of the document."""
    variables = Variables()
    if view is None:
        return variables
    ignore_remarks(view)
    declared: dict[str, _Domains] = {}
    for child in view.children("var", "array"):
        with child.guard():
            ignore_remarks(child)
            name = child.attribute("id")
            if not _ID.fullmatch(name) or name in declared:
                raise MistakeError(f"the id '{shortened(name)}' is not valid or not unique", "write a word, used once")
            declared[name] = {}  # for `as`; invalid unless its domains are set below
            if declared.get(child.attribute("as")) == {} and child.attribute("as") != name:
                continue  # the error in the other declaration is already reported
            domains = _domains(child, name, declared)
            if child.tag == "var":
                if list(domains) != [""]:
                    raise MistakeError(f"the variable {name} has the domains of an array", "write its domain as text")
                variables.add(name, domains[""])
            else:
                size = child.attribute("size")
                if not _SIZE.fullmatch(size) or child.attribute("startIndex") not in {"", "0"}:
                    what = f"the size '{shortened(size)}' or the startIndex of the array {name} is not supported"
                    raise MistakeError(what, 'write size="[3][4]", from index 0')
                shape = tuple(int(part) for part in _BRACKETS.findall(size))
                all_cells = name + "[]" * len(shape)
                variables.add_array(name, shape, [(words or all_cells, values) for words, values in domains.items()])
            declared[name] = domains
    return variables


def _domains(child: ElementView, name: str, declared: Mapping[str, _Domains]) -> _Domains:
    """Return the domains of a variable or an array, copied from another for `as`. Raises `MistakeError`."""
    kind, other = child.attribute("type"), child.attribute("as")
    if kind not in {"", "integer", "symbolic"}:
        what = f'variables of type="{shortened(kind)}" are not supported'
        raise MistakeError(what, "use integer or symbolic variables")
    if other:
        above = [known for known, domains in declared.items() if domains]
        if other not in above:
            what = f'as="{shortened(other)}" is not an id declared above'
            raise MistakeError(what, suggestion(other, above, "ids above"))
        domains = declared[other]
        is_symbolic = isinstance(next(iter(domains.values()))[0], str)
        if kind and is_symbolic != (kind == "symbolic"):
            raise MistakeError(f'type="{kind}" differs from the type of {other}', "delete the attribute type")
        return {re.sub(rf"\b{re.escape(other)}\[", f"{name}[", words): values for words, values in domains.items()}
    if child.tag == "var" or not child.has_children:
        return {"": _domain(child, kind)}
    found: dict[str, Values] = {}
    for part in child.children("domain"):
        words = part.attribute("for")
        if words in found:
            raise part.mistake(f"duplicate domain for '{shortened(words)}'", "delete one of them")
        found[words] = _domain(part, kind)
    return found


def _domain(view: ElementView, kind: str) -> Values:
    """Return the domain in the text of an element. Raises `MistakeError`."""
    words = view.text().split()
    if not words:
        raise MistakeError("a variable has no domain", "write a finite domain: 1..4 7", view.line)
    for word in words:
        if "infinity" in word:
            raise MistakeError("an infinite domain is not supported", "write bounds", view.line)
        if kind == "symbolic" and not _SYMBOL.fullmatch(word):
            raise MistakeError(f"'{shortened(word)}' is not a valid symbol", "write words of letters", view.line)
        if kind != "symbolic" and not re.match("[+-]?[0-9]", word):
            hint = 'write integers or ranges; symbols require type="symbolic"'
            raise MistakeError(f"a domain of integers contains '{shortened(word)}'", hint, view.line)
    if kind == "symbolic":
        return tuple(dict.fromkeys(words))
    parts = sorted((span(word) for word in words), key=lambda part: part.start)
    if sum(map(len, parts)) > MAX_VALUES:
        raise MistakeError(f"a domain has more than {MAX_VALUES:,} values", "use a smaller domain")
    disjoint: list[range] = []
    for part in parts:
        start = max(part.start, disjoint[-1].stop) if disjoint else part.start
        if start < part.stop:
            disjoint.append(range(start, part.stop))
    return merge_ranges(tuple(disjoint))


def domain_of(values: Values, symbols: Mapping[str, int], name: str) -> Domain:
    """Return a domain of the team; `symbols` are all symbols with their integers."""
    codes = sorted(symbols[part] for part in values if isinstance(part, str))
    if codes:
        return Domain(name, tuple(range(code, code + 1) for code in codes), tuple(symbols))
    return Domain(name, tuple(part for part in values if isinstance(part, range)))


def values_of(words: Iterable[str]) -> list[int]:
    """Return the integers in a list of words, with ranges expanded. Raises `MistakeError`."""
    found: list[int] = []
    for word in words:
        part = span(word) if ".." in word else (integer(word),)
        if len(found) + len(part) > MAX_VALUES:
            raise MistakeError(f"a list has more than {MAX_VALUES:,} values", "shorten the list")
        found += part
    return found
