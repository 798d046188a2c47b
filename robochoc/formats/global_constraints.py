"""Read and write the global constraints of XCSP 2.1: `allDifferent`, `weightedSum`, `element`, `cumulative`.

Each constraint gets an equivalent expression as its body, and keeps its written form. Roussel and Lecoutre, "XML
Representation of Constraint Networks: Format XCSP 2.1", 2009; docs/reference/format.md, "Global constraints".
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import is_name
from robochoc.model.constraint import GlobalPredicate, Term
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.expression.parser import MAX_NODES

PREFIX = "global:"
"""The prefix of references to global constraints."""

_WORD = re.compile(r"[][{}]|<[a-z]+/>|[^][{}<>\s]+")
_INTEGER = re.compile(r"[+-]?[0-9]{1,18}")
_COMPARISONS = ("eq", "ne", "ge", "gt", "le", "lt")
_NIL = "<nil/>"
_SPLIT = "split it into several"


def read_global(reference: str, parameters: etree._Element | None, scope: Sequence[Term]) -> GlobalPredicate:
    """Read a global constraint, and return it with formal parameters. Raises `MistakeError`.

    Args:
        reference: The name of the constraint, including the prefix `global:`.
        parameters: The element with the parameters. None: the terms in `scope` are used (allDifferent only).
        scope: The terms of the constraint's scope.
    """
    text = "" if parameters is None else parameters.text or ""
    for child in () if parameters is None else parameters:
        text += f" <{child.tag}/> {child.tail or ''}"
    words = _WORD.findall(text)
    if parameters is None and reference == f"{PREFIX}allDifferent":
        words = ["[", *map(str, scope), "]"]
    formals: dict[str, str] = {}
    form = [formals.setdefault(word, f"X{len(formals)}") if is_name(word) else word for word in words]
    return _expanded(reference, form)


def variables_of(parameters: etree._Element | None, scope: Sequence[Term]) -> tuple[Term, ...]:
    """Return the variables in the parameters of a global constraint, in the order of the formal parameters."""
    if parameters is None:
        return tuple(dict.fromkeys(term for term in scope if isinstance(term, str)))
    text = " ".join([parameters.text or "", *(child.tail or "" for child in parameters)])
    return tuple(dict.fromkeys(word for word in _WORD.findall(text) if is_name(word)))


def write_global(element: etree._Element, predicate: GlobalPredicate, terms: Sequence[Term]) -> None:
    """Write the form of a global constraint to `element`, with `terms` instead of the formal parameters."""
    actual = dict(zip(predicate.parameters, map(str, terms), strict=True))
    text, last = "", None
    for word in predicate.form.split():
        if word.startswith("<"):
            _append(element, last, text)
            last, text = etree.SubElement(element, word[1:-2]), ""
        else:
            text += f"{actual.get(word, word)} "
    _append(element, last, text)


def check_global(predicate: GlobalPredicate) -> None:
    """Raise `MistakeError` unless the body of a global constraint follows from its form."""
    form: object = predicate.form
    expected = _expanded(predicate.name, form.split() if isinstance(form, str) else [])
    if (expected.parameters, expected.body) != (predicate.parameters, predicate.body):
        message = f"the body of {shortened(predicate.name)} does not follow from its form"
        raise MistakeError(message, "create it with `read_form`")
    if predicate.symbolic and predicate.name != f"{PREFIX}allDifferent":
        raise MistakeError(f"{shortened(predicate.name)} cannot contain symbols", "only allDifferent accepts symbols")


def read_form(reference: str, form: str) -> GlobalPredicate:
    """Return a global constraint with formal parameters `X0`, `X1`, ... from its `form`: `[ X0 X1 X2 ]`.

    Args:
        reference: The name of the constraint, including the prefix `global:`.
        form: Its parameters in the syntax of XCSP 2.1, with formal parameters instead of variables, in the order of
            their numbers.

    Raises:
        MistakeError: if the global constraint is unknown, or its parameters are invalid.
    """
    return _expanded(reference, _WORD.findall(form))


def is_global(reference: str) -> bool:
    """Return whether `reference` is the name of a global constraint."""
    return reference.startswith(PREFIX)


def _append(element: etree._Element, last: etree._Element | None, text: str) -> None:
    if last is None:
        element.text = text.strip()
    else:
        last.tail = f" {text.strip()}" if text else None


def _expanded(reference: str, form: Sequence[str]) -> GlobalPredicate:
    kind = reference.removeprefix(PREFIX)
    if kind not in _KINDS or not is_global(reference):
        known = " ".join(PREFIX + one for one in _KINDS)
        raise MistakeError(f"unknown global constraint '{shortened(reference)}'", f"supported: {known}")
    if len(form) > MAX_NODES:
        raise MistakeError(f"{reference} has {len(form)} words", f"use at most {MAX_NODES}: {_SPLIT}")
    words = _WordReader(reference, form)
    body = _KINDS[kind](words)
    words.end()
    names = tuple(dict.fromkeys(word for word in form if is_name(word)))
    return GlobalPredicate(reference, names, body, form=" ".join(form))


class _WordReader:
    """Reads the words in a form, one after the other."""

    def __init__(self, reference: str, words: Sequence[str]) -> None:
        self._reference = reference
        self._words = words
        self._next = 0

    def is_next(self, word: str) -> bool:
        return self._next < len(self._words) and self._words[self._next] == word

    def skip(self, word: str) -> bool:
        """Skip `word` if it is next. Return whether it was."""
        found = self.is_next(word)
        self._next += found
        return found

    def expect(self, word: str) -> None:
        if not self.skip(word):
            raise self.error(f"'{word}'")

    def term(self) -> Expression:
        """Read a variable or an integer."""
        word = self._words[self._next] if self._next < len(self._words) else ""
        if is_name(word):
            self._next += 1
            return Name(word)
        if not _INTEGER.fullmatch(word):
            raise self.error("a variable or an integer")
        self._next += 1
        return Constant(int(word))

    def read_list(self, opening: str, read_item: Callable[[], Expression], closing: str) -> Iterator[Expression]:
        """Yield the items between brackets."""
        self.expect(opening)
        while not self.skip(closing):
            yield read_item()

    def comparison(self, allowed: Collection[str]) -> str:
        for word in allowed:
            if self.skip(f"<{word}/>"):
                return word
        raise self.error(" or ".join(f"<{word}/>" for word in allowed))

    def check_number(self, number: int, most: int, items: str) -> None:
        """Raise `MistakeError` if the number of items would make the expression too long."""
        if number > most:
            raise MistakeError(f"{self._reference} has {number} {items}", f"use at most {most}: {_SPLIT}")

    def end(self) -> None:
        if self._next < len(self._words):
            raise self.error("the end")

    def error(self, wanted: str) -> MistakeError:
        """Return the error for an unexpected next word."""
        found = f"'{shortened(self._words[self._next])}'" if self._next < len(self._words) else "the end"
        hint = f"write {_EXAMPLES[self._reference.removeprefix(PREFIX)]}"
        return MistakeError(f"in the parameters of {self._reference}: expected {wanted}, found {found}", hint)


def _all_different(words: _WordReader) -> Expression:
    terms = list(words.read_list("[", words.term, "]"))
    if len(terms) <= 1:
        raise words.error("a list of two terms or more")
    words.check_number(len(terms), 80, "terms")
    return _joined("and", [Apply("ne", pair) for pair in itertools.combinations(terms, 2)])


def _weighted_sum(words: _WordReader) -> Expression:
    def product() -> Expression:
        words.expect("{")
        weight, term = words.term(), words.term()
        words.expect("}")
        if not isinstance(weight, Constant):
            raise words.error("an integer before each variable")
        return term if weight.value == 1 else Apply("mul", (weight, term))

    products = list(words.read_list("[", product, "]"))
    words.check_number(len(products), 2000, "terms")
    if not products:
        raise words.error("a list of {weight variable}")
    operator = words.comparison(_COMPARISONS)
    return Apply(operator, (_joined("add", products), words.term()))


def _element(words: _WordReader) -> Expression:
    """Return `items[index] = value`. The index starts at 1."""
    outer = words.skip("[")
    index = words.term()
    items = list(words.read_list("[", words.term, "]"))
    words.check_number(len(items), 1000, "items")
    if not items:
        raise words.error("a list of one term or more")
    value = words.term()
    if outer:
        words.expect("]")
    cases = [
        Apply("and", (Apply("eq", (index, Constant(place))), Apply("eq", (item, value))))
        for place, item in enumerate(items, start=1)
    ]
    return _joined("or", cases)


class _Task:
    """A task in a cumulative constraint: at least two of origin, duration and end, and the height."""

    def __init__(self, words: _WordReader) -> None:
        words.expect("{")
        given = [None if words.skip(_NIL) else words.term()]
        while not words.skip("}"):
            given.append(None if words.skip(_NIL) else words.term())
        origin, duration, end, height = self._parts(given, words)
        self.conditions = [Apply("ge", (part, Constant(0))) for part in (duration, height) if isinstance(part, Name)]
        """The conditions on this task only."""
        for part in (duration, height):
            if isinstance(part, Constant) and part.value < 0:
                raise words.error("tasks with durations and heights of 0 or more")
        if origin and duration and end:
            self.conditions.append(Apply("eq", (Apply("add", (origin, duration)), end)))
        self.start = origin or Apply("sub", (_given(end), _given(duration)))
        self.end = end or Apply("add", (_given(origin), _given(duration)))
        if origin and end and not duration:
            self.conditions.append(Apply("le", (origin, end)))
        self.height = height

    @staticmethod
    def _parts(
        given: list[Expression | None], words: _WordReader
    ) -> tuple[Expression | None, Expression | None, Expression | None, Expression]:
        match given:
            case [origin, duration, height] if origin and duration and height:
                return origin, duration, None, height
            case [origin, duration, end, height] if height and [origin, duration, end].count(None) <= 1:
                return origin, duration, end, height
            case _:
                raise words.error(
                    "{origin duration height} or {origin duration end height}, in which one may be <nil/>,"
                )

    def load(self, now: Expression) -> Expression:
        """Return the load of the task at the time `now`."""
        runs = Apply("and", (Apply("le", (self.start, now)), Apply("lt", (now, self.end))))
        return Apply("if", (runs, self.height, Constant(0)))


def _cumulative(words: _WordReader) -> Expression:
    """Compare the load with the limit at the start of each task, since the load increases at no other time."""
    words.expect("[")
    tasks = []
    while not words.skip("]"):
        tasks.append(_Task(words))
        words.check_number(len(tasks), 25, "tasks")
    if not tasks:
        raise words.error("a task")
    words.skip("<le/>")
    limit = words.term()
    conditions: list[Expression] = [one for task in tasks for one in task.conditions]
    conditions += [Apply("le", (_joined("add", [other.load(task.start) for other in tasks]), limit)) for task in tasks]
    return _joined("and", conditions)


def _given(part: Expression | None) -> Expression:
    if part is None:
        raise ValueError("a task must have exactly two of origin, duration and end")
    return part


def _joined(operator: str, terms: Iterable[Expression]) -> Expression:
    several = tuple(terms)
    return several[0] if len(several) == 1 else Apply(operator, several)


_KINDS: dict[str, Callable[[_WordReader], Expression]] = {
    "allDifferent": _all_different,
    "weightedSum": _weighted_sum,
    "element": _element,
    "cumulative": _cumulative,
}
_EXAMPLES = {
    "allDifferent": "[ V0 V1 V2 ]",
    "weightedSum": "[ {1 V0} {-1 V1} ] <le/> 3",
    "element": "V0 [ 5 V1 7 ] V2: the index V0, from 1 on, selects V2",
    "cumulative": "[ {V0 2 1} {V1 2 <nil/> 1} ] <le/> 1",
}
__all__ = ["check_global", "is_global", "read_form", "read_global", "variables_of", "write_global"]
