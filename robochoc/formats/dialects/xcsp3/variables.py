"""The variables of an XCSP3 instance: single ones, arrays, their domains, and the compact lists `x[][1..2]`."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from robochoc.formats.definitions import MAX_VALUES
from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.formats.dialects.xcsp3.document import ignore_remarks
from robochoc.formats.dialects.xcsp3.terms import integer, span, words_of
from robochoc.formats.element_view import ElementView
from robochoc.model.problem import Domain
from robochoc.model.ranges import merge_ranges

MAX_VARIABLES = 100_000
"""The maximum number of variables, and of variables in one list."""

_ID = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SYMBOL = re.compile(r"[A-Za-z_][^(){},*%|:<>&\"']*")
_SIZE = re.compile(r"(?:\[[0-9]{1,9}\])+")
_COMPACT = re.compile(r"([A-Za-z][A-Za-z0-9_]*)((?:\[[0-9.]*\])+)")
_BRACKETS = re.compile(r"\[([0-9.]*)\]")
_MANY_TIMES = re.compile(r"([+-]?[0-9]{1,18})x([0-9]{1,9})")

Values = tuple[range, ...] | tuple[str, ...]
"""A domain as it is written: ranges of integers, or symbols."""
_Domains = Mapping[str, Values]
"""The domains of a variable or an array, by the text that names the variables; an empty text names all."""


@dataclass
class Variables:
    """All variables of an instance.

    Attributes:
        domains: Their domains by id, in the order in which they are declared.
        shapes: The sizes of arrays, by id.
    """

    domains: dict[str, Values] = field(default_factory=dict)
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)

    @property
    def symbols(self) -> tuple[str, ...]:
        """All symbols, in the order in which they are first written."""
        all_symbols = (symbol for domain in self.domains.values() for symbol in domain if isinstance(symbol, str))
        return tuple(dict.fromkeys(all_symbols))

    def is_symbolic(self, name: str) -> bool:
        """Return whether the values of a variable are symbols."""
        return isinstance(self.domains[name][0], str)

    def expand(self, words: str) -> Iterator[str]:
        """Yield the variables that a list of words means, and the other words as they are; `2x3` is `2 2 2`.

        Raises:
            MistakeError: if there is no such variable, or too many.
        """
        number = 0
        for word in words_of(words):
            for one in self._expand_word(word):
                number += 1
                if number > MAX_VARIABLES:
                    raise MistakeError(f"a list of more than {MAX_VARIABLES:,}", "split it")
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
            raise MistakeError(f"'{shortened(text)}' is not a valid matrix", "two of its indexes must be open")
        row, column = wide
        found = []
        for one in indexes[row]:
            chosen = list(indexes)
            chosen[row] = range(one, one + 1)
            found.append(self._cells(match[1], chosen))
            if len(indexes[column]) != len(found[-1]):
                raise MistakeError(f"'{shortened(text)}' has holes", "name its variables one by one")
        return found

    def add(self, name: str, domain: Values) -> None:
        """Declare a variable. Raises `MistakeError`."""
        if name in self.domains:
            raise MistakeError(f"a second variable '{shortened(name)}'", "ids are unique")
        if len(self.domains) == MAX_VARIABLES:
            raise MistakeError(f"more than {MAX_VARIABLES:,} variables", "import a smaller problem")
        self.domains[name] = domain

    def add_array(self, name: str, shape: tuple[int, ...], domains: Sequence[tuple[str, Values]]) -> None:
        """Declare the variables of an array; `domains` says for which of them, or `others`. Raises `MistakeError`."""
        if math.prod(shape) > MAX_VARIABLES:
            raise MistakeError(f"an array of {math.prod(shape):,} variables", f"{MAX_VARIABLES:,} are allowed")
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
                        raise MistakeError(f"two domains for {cell}", "write one of them")
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
            raise MistakeError(f"{name}{shortened(brackets)} is not in the array {name}", f"its sizes are {shape}")
        return found

    def _cells(self, name: str, indexes: Sequence[range], *, declared: bool = True) -> list[str]:
        cells = (name + "".join(f"[{index}]" for index in place) for place in itertools.product(*indexes))
        return [cell for cell in cells if not declared or cell in self.domains]


def lists(text: str) -> list[list[str]]:
    """Return the words of `(1,2)(3,4)`, list by list. Raises `MistakeError`."""
    text = text.strip()
    if not text.startswith("(") or not text.endswith(")"):
        raise MistakeError(f"'{shortened(text)}' is not a sequence of lists in parentheses", "write (1,2)(3,4)")
    return [row.split(",") for row in re.split(r"\)\s*\(", text[1:-1])]


def read_variables(view: ElementView | None) -> Variables:
    """Return the variables that `<variables>` declares; mistakes go into the report of the document."""
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
                raise MistakeError(f"the id '{shortened(name)}' is not allowed", "ids are words, each used once")
            declared[name] = {}  # for `as`; invalid unless its domains are set below
            if declared.get(child.attribute("as")) == {} and child.attribute("as") != name:
                continue  # a consequence of an error reported there
            domains = _domains(child, name, declared)
            if child.tag == "var":
                if list(domains) != [""]:
                    raise MistakeError(f"the variable {name} has the domains of an array", "write its domain as text")
                variables.add(name, domains[""])
            else:
                size = child.attribute("size")
                if not _SIZE.fullmatch(size) or child.attribute("startIndex") not in {"", "0"}:
                    raise MistakeError(f"an array of size '{shortened(size)}'", 'write size="[3][4]", from index 0')
                shape = tuple(int(part) for part in _BRACKETS.findall(size))
                all_cells = name + "[]" * len(shape)
                variables.add_array(name, shape, [(words or all_cells, values) for words, values in domains.items()])
            declared[name] = domains
    return variables


def _domains(child: ElementView, name: str, declared: Mapping[str, _Domains]) -> _Domains:
    """Return the domains of a variable or an array; with `as`, those of one above. Raises `MistakeError`."""
    kind, other = child.attribute("type"), child.attribute("as")
    if kind not in {"", "integer", "symbolic"}:
        raise MistakeError(f'variables of type="{shortened(kind)}" are not supported', "integer and symbolic are")
    if other:
        above = [known for known, domains in declared.items() if domains]
        if other not in above:
            raise MistakeError(f'as="{shortened(other)}" names nothing above', suggestion(other, above, "ids above"))
        domains = declared[other]
        is_symbolic = isinstance(next(iter(domains.values()))[0], str)
        if kind and is_symbolic != (kind == "symbolic"):
            raise MistakeError(f'type="{kind}" differs from the type of {other}', "leave it out")
        return {re.sub(rf"\b{re.escape(other)}\[", f"{name}[", words): values for words, values in domains.items()}
    if child.tag == "var" or not child.has_children:
        return {"": _domain(child, kind)}
    found: dict[str, Values] = {}
    for part in child.children("domain"):
        words = part.attribute("for")
        if words in found:
            raise part.mistake(f"a second domain for '{shortened(words)}'", "write one of them")
        found[words] = _domain(part, kind)
    return found


def _domain(view: ElementView, kind: str) -> Values:
    """Return the domain in the text of an element. Raises `MistakeError`."""
    words = view.text().split()
    if not words:
        raise MistakeError("a variable without a domain", "only finite domains are supported: 1..4 7", view.line)
    for word in words:
        if "infinity" in word:
            raise MistakeError("an infinite domain is not supported", "give it bounds", view.line)
        if kind == "symbolic" and not _SYMBOL.fullmatch(word):
            raise MistakeError(f"'{shortened(word)}' is not a valid symbol", "write words of letters", view.line)
        if kind != "symbolic" and not re.match("[+-]?[0-9]", word):
            hint = 'write integers or ranges; symbols require type="symbolic"'
            raise MistakeError(f"'{shortened(word)}' in a domain of integers", hint, view.line)
    if kind == "symbolic":
        return tuple(dict.fromkeys(words))
    parts = sorted((span(word) for word in words), key=lambda part: part.start)
    if sum(map(len, parts)) > MAX_VALUES:
        raise MistakeError(f"a domain of more than {MAX_VALUES:,} values", "make it smaller")
    disjoint: list[range] = []
    for part in parts:
        start = max(part.start, disjoint[-1].stop) if disjoint else part.start
        if start < part.stop:
            disjoint.append(range(start, part.stop))
    return merge_ranges(tuple(disjoint))


def domain_of(values: Values, symbols: Mapping[str, int], name: str) -> Domain:
    """Return a domain as our model has it; `symbols` are all symbols with the integers that stand for them."""
    codes = sorted(symbols[part] for part in values if isinstance(part, str))
    if codes:
        return Domain(name, tuple(range(code, code + 1) for code in codes), tuple(symbols))
    return Domain(name, tuple(part for part in values if isinstance(part, range)))


def values_of(words: Iterable[str]) -> list[int]:
    """Return the integers in a list of words, where `1..3` are three. Raises `MistakeError`."""
    found: list[int] = []
    for word in words:
        part = span(word) if ".." in word else (integer(word),)
        if len(found) + len(part) > MAX_VALUES:
            raise MistakeError(f"more than {MAX_VALUES:,} values", "shorten the list")
        found += part
    return found
