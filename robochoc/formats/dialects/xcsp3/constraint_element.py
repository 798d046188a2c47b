"""A constraint element; in a group or a slide, with the arguments for its parameters `%0`, `%1`, `%...`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.document import flag
from robochoc.formats.dialects.xcsp3.expressions import integer, zip_equal
from robochoc.formats.dialects.xcsp3.variables import Variables
from robochoc.formats.element_view import ElementView
from robochoc.system.lazy_dataclass import dataclass

_PARAMETER = re.compile(r"%([0-9]{1,6}|\.\.\.)")


@dataclass(frozen=True)
class Element:
    """A constraint element and the arguments for its parameters.

    Attributes:
        view: The element.
        variables: The variables of the instance.
        arguments: The arguments. None: the element is not a template.
    """

    view: ElementView
    variables: Variables
    arguments: Sequence[str] | None = None

    @property
    def kind(self) -> str:
        """The kind of constraint."""
        return self.view.tag

    def has(self, child: str) -> bool:
        """Return whether there is a child of this name."""
        return self.view.has(child)

    def text(self, child: str = "") -> str:
        """Return the text of a child, or of the element itself. Raises `MistakeError` if there is no such child."""
        return self._substituted(self.view.required(child) if child else self.view)

    def texts(self, child: str) -> list[str]:
        """Return the texts of all children of this name."""
        return [self._substituted(found) for found in self.view.children(child)]

    def words(self, child: str) -> list[str]:
        """Return the words of a child; compact forms are expanded. Raises `MistakeError`."""
        return list(self.variables.expand(self.text(child)))

    def lists(self) -> list[list[str]]:
        """Return the words of each `<list>`; if the element has no children, the words of its text."""
        if not self.view.has_children:
            return [list(self.variables.expand(self.text()))]
        texts = self.texts("list") or [self.text("list")]
        return [list(self.variables.expand(text)) for text in texts]

    def only_list(self) -> list[str]:
        """Return the words of the only `<list>`; if the element has no children, the words of its text."""
        return self.words("list") if self.view.has_children else self.lists()[0]

    def matrix(self, child: str) -> list[list[str]]:
        """Return the rows of a child that is a matrix. Raises `MistakeError`."""
        rows = self.variables.matrix(self.text(child))
        if not rows or any(len(row) != len(rows[0]) for row in rows):
            raise MistakeError("the rows of the matrix have different lengths", "write rows of one length")
        return rows

    def attribute(self, name: str, child: str = "") -> str:
        """Return an attribute of the element or of a child; empty if it is missing."""
        return (self.view.required(child) if child else self.view).attribute(name)

    def start_index(self, name: str = "startIndex", child: str = "list") -> int:
        """Return the index of the first element of a list. Raises `MistakeError`."""
        return first_index(self.view.required(child), name) if self.has(child) else 0

    def is_true(self, name: str, child: str = "", *, default: bool = False) -> bool:
        """Return the truth value of an attribute of the element or of a child. Raises `MistakeError`."""
        return flag(self.view.required(child) if child else self.view, name, default=default)

    @cached_property
    def arity(self) -> int:
        """The number of parameters `%0`, `%1`, ... in the element."""
        return max((int(number) + 1 for number in self._parameters if number != "..."), default=0)

    @cached_property
    def _parameters(self) -> list[str]:
        return _PARAMETER.findall(self.view.all_text())

    def with_arguments(self, arguments: Sequence[str]) -> Element:
        """Return the template with `arguments`. Raises `MistakeError` if some are unused."""
        if len(arguments) > self.arity and "..." not in self._parameters:
            what = f"{len(arguments)} arguments for a template of {self.arity} parameters"
            raise MistakeError(what, "write one for each parameter")
        return Element(self.view, self.variables, arguments)

    def _substituted(self, view: ElementView) -> str:
        text = view.text()
        if "%" not in text:
            return text
        arguments = self.arguments
        if arguments is None:
            raise MistakeError("there is a parameter outside <group> and <slide>", "name the variable", view.line)

        def argument(match: re.Match[str]) -> str:
            if match[1] == "...":
                return " ".join(arguments[self.arity :])
            if int(match[1]) >= len(arguments):
                what = f"there is no argument for %{match[1]}, since <args> has only {len(arguments)}"
                raise MistakeError(what, "add the missing arguments to <args>")
            return arguments[int(match[1])]

        return _PARAMETER.sub(argument, text)


def first_index(view: ElementView, name: str = "startIndex") -> int:
    """Return the index of the first element of a list. Raises `MistakeError`."""
    return integer(view.attribute(name) or "0")


def slide_scopes(slide: ElementView, variables: Variables, arity: int) -> Iterator[list[str]]:
    """Yield the arguments of each constraint of a `<slide>`, whose template has `arity` parameters.

    Raises:
        MistakeError: if the attributes of the slide are invalid.
    """
    lists = slide.children("list")
    members = [list(variables.expand(one.text())) for one in lists]
    offsets = [_positive(one, "offset", 1) for one in lists]
    collects = [_positive(one, "collect", arity if len(lists) == 1 else 1) for one in lists]
    circular = flag(slide, "circular")
    if not lists or (circular and len(lists) > 1):
        what = f"<slide> has {len(lists)} elements <list>"
        raise MistakeError(what, "write one or more; with circular, write one", slide.line)
    number = 0
    while True:
        starts = [number * offset for offset in offsets]
        if circular:
            fits = starts[0] < len(members[0])
        else:
            fits = all(start + collect <= len(words) for start, collect, words in zip_equal(starts, collects, members))
        if not fits:
            return
        yield [
            words[(start + step) % len(words)]
            for start, collect, words in zip_equal(starts, collects, members)
            for step in range(collect)
        ]
        number += 1


def _positive(view: ElementView, name: str, default: int) -> int:
    word = view.attribute(name)
    if not word:
        return default
    if not word.isdecimal() or not 0 < len(word) < 7 or int(word) == 0:  # noqa: PLR2004 - digits
        raise MistakeError(f'{name}="{shortened(word)}" is not valid', "write an integer of 1 or more", view.line)
    return int(word)
