"""Global constraints of XCSP 2.1: unchanged if robochoc has the same constraint, else as predicates.

Syntax: Roussel and Lecoutre, "XML representation of constraint networks: format XCSP 2.1" (arXiv 0902.2362), and the
manual of FRODO, which adds `diff2`, and intervals in `element`.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from typing import NoReturn

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp21.instance import Formula
from robochoc.formats.dialects.xcsp21.numbers import integer, is_integer
from robochoc.formats.element_view import ElementView
from robochoc.formats.global_constraints import PREFIX, read_form
from robochoc.model.constraint import Predicate
from robochoc.model.expression import Apply, Constant, Expression, Name

Term = str | int

MAX_TERMS = 500
"""The maximum number of variables and constants of a global constraint."""
MAX_BOXES = 100
"""The maximum number of rectangles: there is one predicate for each pair."""

_TOKEN = re.compile(r"[][{}]|<\w+>|[^][{}<\s]+")
_ZERO = Constant(0)


def expand_global(name: str, element: ElementView, scope: Sequence[str]) -> list[Formula]:
    """Return a global constraint as predicates.

    Args:
        name: Its name, without `global:`.
        element: The constraint.
        scope: The variables of its scope.

    Raises:
        MistakeError: if the constraint is not supported, or its parameters are invalid.
    """
    if name not in _EXPANSIONS:
        known = " ".join(_EXPANSIONS)
        what = f"the global constraint '{shortened(name)}' is not supported"
        raise MistakeError(what, f"use one of {known}")
    tokens = _Tokens(element.child("parameters"), name)
    formulas = list(_EXPANSIONS[name](tokens, scope))
    tokens.end()
    return formulas


def _unchanged(tokens: _Tokens, _scope: Sequence[str]) -> Iterator[Formula]:
    """Yield a constraint that robochoc has, too."""
    formals: dict[str, str] = {}
    form = []
    for word in tokens.rest():
        if word[0] in "[]{}<" or is_integer(word):
            form.append(f"{word[:-1]}/>" if word[0] == "<" else word)
        else:
            form.append(formals.setdefault(word, f"X{len(formals)}"))
    kind = "element" if tokens.name == "elementFast" else tokens.name
    yield Formula(read_form(f"{PREFIX}{kind}", " ".join(form)), tuple(formals))


class _Tokens:
    """The parameters of a global constraint, word by word. A child element `<eq/>` is the word `<eq>`."""

    def __init__(self, element: ElementView | None, name: str) -> None:
        self.name = name
        parts = element.mixed() if element is not None else ()
        text = " ".join(part if isinstance(part, str) else f"<{part.tag}>" for part in parts)
        self._words = _TOKEN.findall(text)
        self._next = 0
        if len(self._words) > 10 * MAX_TERMS:
            what = f"global:{name} has too many parameters"
            raise MistakeError(what, f"split it into constraints of at most {MAX_TERMS} variables")

    def __bool__(self) -> bool:
        return self._next < len(self._words)

    @property
    def peek(self) -> str:
        return self._words[self._next] if self else ""

    def next(self) -> str:
        word = self.peek
        self._next += 1
        return word

    def has(self, part: str) -> bool:
        """Return whether a word contains `part`."""
        return any(part in word for word in self._words)

    def rest(self) -> list[str]:
        """Return all remaining words."""
        words = self._words[self._next :]
        self._next = len(self._words)
        return words

    def expect(self, word: str) -> None:
        if self.peek != word:
            self.fail(word)
        self._next += 1

    def term(self) -> Term:
        word = self.next()
        if not word or word[0] in "[]{}<":
            self._next -= 1
            self.fail("a variable or an integer")
        return integer(word) if is_integer(word) else word

    def terms(self, opening: str, closing: str) -> list[Term]:
        """Return the terms between two brackets."""
        self.expect(opening)
        found = []
        while self.peek != closing:
            found.append(self.term())
        self.expect(closing)
        return found

    def end(self) -> None:
        if self:
            self.fail("the end")

    def fail(self, expected: str) -> NoReturn:
        there = shortened(self.peek) or "the end"
        what = f"the parameters of global:{self.name} have '{there}', expected {expected}"
        raise MistakeError(what, "see the syntax of this constraint in XCSP 2.1")


class _Body:
    """Builds an expression over terms, whose variables become formal parameters."""

    def __init__(self) -> None:
        self._formals: dict[str, str] = {}

    def term_expression(self, term: Term) -> Expression:
        if isinstance(term, int):
            return Constant(term)
        return Name(self._formals.setdefault(term, f"X{len(self._formals)}"))

    def formula(self, name: str, body: Expression) -> Formula:
        return Formula(Predicate(name, tuple(self._formals.values()), body), tuple(self._formals))


def _all_different(tokens: _Tokens, scope: Sequence[str]) -> Iterator[Formula]:
    """Yield one predicate for each pair, since protocols and filters for binary constraints accept these."""
    terms = tokens.terms("[", "]") if tokens else list(scope)
    if len(terms) > MAX_TERMS:
        what = f"global:allDifferent has {len(terms)} terms"
        raise MistakeError(what, f"split it into constraints of at most {MAX_TERMS} terms")
    for one, other in itertools.combinations(terms, 2):
        body = _Body()
        yield body.formula("different", Apply("ne", (body.term_expression(one), body.term_expression(other))))


def _element(tokens: _Tokens, scope: Sequence[str]) -> Iterator[Formula]:
    """Yield `element`, whose index starts at 1. One of FRODO's intervals allows each of its values."""
    if not tokens.has(".."):
        yield from _unchanged(tokens, scope)
        return
    body = _Body()
    index = tokens.term()
    items: list[Expression | tuple[int, int]] = []
    tokens.expect("[")
    while tokens.peek != "]":
        first, dots, last = tokens.peek.partition("..")
        if dots:
            tokens.next()
            items.append((integer(first), integer(last)))
        else:
            items.append(body.term_expression(tokens.term()))
    tokens.expect("]")
    value = body.term_expression(tokens.term())
    cases = []
    for number, item in enumerate(items, 1):
        same = (
            Apply("and", (Apply("ge", (value, Constant(item[0]))), Apply("le", (value, Constant(item[1])))))
            if isinstance(item, tuple)
            else Apply("eq", (value, item))
        )
        cases.append(Apply("and", (Apply("eq", (body.term_expression(index), Constant(number))), same)))
    yield body.formula(tokens.name, _joined("or", cases) if cases else Apply("ne", (_ZERO, _ZERO)))


def _diff2(tokens: _Tokens, _scope: Sequence[str]) -> Iterator[Formula]:
    """Yield one predicate for each pair of rectangles: they do not overlap. An empty rectangle overlaps with none."""
    rectangles = []
    tokens.expect("[")
    while tokens.peek != "]":
        tokens.expect("[")
        rectangle = [*tokens.terms("{", "}"), *tokens.terms("{", "}")]
        tokens.expect("]")
        if len(rectangle) != 4:  # noqa: PLR2004 - two dimensions
            what = "a rectangle of global:diff2 requires two coordinates and two sizes"
            raise MistakeError(what, "write [{x y} {dx dy}]")
        rectangles.append(rectangle)
    tokens.expect("]")
    _check_count(rectangles, tokens.name)
    for one, other in itertools.combinations(rectangles, 2):
        body = _Body()
        sides = [
            Apply(
                "le",
                (
                    Apply("add", (body.term_expression(left[axis]), body.term_expression(left[axis + 2]))),
                    body.term_expression(right[axis]),
                ),
            )
            for left, right in ((one, other), (other, one))
            for axis in (0, 1)
        ]
        sides += [Apply("le", (body.term_expression(box[axis]), _ZERO)) for box in (one, other) for axis in (2, 3)]
        yield body.formula("diff2", Apply("or", tuple(sides)))


def _check_count(boxes: Sequence[object], name: str) -> None:
    if len(boxes) > MAX_BOXES:
        what = f"global:{name} has {len(boxes)} rectangles"
        raise MistakeError(what, f"split it into constraints of at most {MAX_BOXES} rectangles")


def _joined(operator: str, terms: Sequence[Expression]) -> Expression:
    return terms[0] if len(terms) == 1 else Apply(operator, tuple(terms))


_EXPANSIONS: dict[str, Callable[[_Tokens, Sequence[str]], Iterator[Formula]]] = {
    "allDifferent": _all_different,
    "weightedSum": _unchanged,
    "element": _element,
    "elementFast": _element,
    "cumulative": _unchanged,
    "diff2": _diff2,
}
