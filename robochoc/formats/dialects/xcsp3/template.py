"""One constraint element, also of a group or a slide: then `%0`, `%1`, `%...` stand for arguments."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp3.document import attribute, content, line
from robochoc.formats.dialects.xcsp3.variables import Variables

_PARAMETER = re.compile(r"%([0-9]{1,6}|\.\.\.)")
_REIFIED = ("reifiedBy", "hreifiedFrom", "hreifiedTo")


@dataclass(frozen=True)
class Element:
    """A constraint element and the arguments that its parameters stand for.

    Attributes:
        xml: The element.
        variables: The variables of the instance.
        arguments: The arguments. None: it is no template.
    """

    xml: etree._Element
    variables: Variables
    arguments: Sequence[str] | None = None

    @property
    def kind(self) -> str:
        """The kind of constraint."""
        return self.xml.tag

    def has(self, child: str) -> bool:
        """Return whether there is a child of this name."""
        return self.xml.find(child) is not None

    def count(self, child: str) -> int:
        """Return the number of children of this name."""
        return len(self.xml.findall(child))

    def refuse(self, *children: str) -> None:
        """Raise `MistakeError` where there is a child that has no counterpart."""
        for child in children:
            if self.has(child):
                raise MistakeError(f"<{child}> in <{self.kind}> has no counterpart", "write it without")

    def text(self, child: str = "") -> str:
        """Return the text of a child, or of the element itself. Raises `MistakeError` where there is no such child."""
        return self._filled(self._child(child))

    def texts(self, child: str) -> list[str]:
        """Return the texts of all children of this name."""
        return [self._filled(found) for found in self.xml.findall(child)]

    def words(self, child: str) -> list[str]:
        """Return the words of a child; compact forms are written out. Raises `MistakeError`."""
        return list(self.variables.named(self.text(child)))

    def every(self, child: str) -> list[list[str]]:
        """Return the words of each child of this name."""
        return [list(self.variables.named(text)) for text in self.texts(child)]

    def whole(self) -> list[str]:
        """Return the words of `<list>`, or of the element where it has no children."""
        return self.words("list" if len(self.xml) else "")

    def matrix(self, child: str) -> list[list[str]]:
        """Return the rows of a child that is a matrix. Raises `MistakeError`."""
        rows = self.variables.matrix(self.text(child))
        if not rows or any(len(row) != len(rows[0]) for row in rows):
            raise MistakeError("a matrix whose rows have different lengths", "give them one length")
        return rows

    def attribute(self, name: str, child: str = "", place: int = 0) -> str:
        """Return an attribute of the element, or of one of its children; empty where there is none."""
        if not child:
            return attribute(self.xml, name)
        found = self.xml.findall(child)
        return attribute(found[place], name) if place < len(found) else ""

    def check(self) -> None:
        """Raise `MistakeError` for a constraint that is soft or stands for the value of a variable."""
        for name in _REIFIED:
            if self.attribute(name):
                raise MistakeError(f"{name} has no counterpart", "write it as <intension>: iff(b,le(x,y))")
        if self.attribute("type") == "soft" or self.attribute("violationCost"):
            raise MistakeError("a soft constraint of XCSP3 has no counterpart", "write its cost in <objectives>")

    @cached_property
    def arity(self) -> int:
        """The number of parameters `%0`, `%1`, ... in the element."""
        text = "".join(str(part) for part in self.xml.itertext())
        return max((int(found) + 1 for found in _PARAMETER.findall(text) if found != "..."), default=0)

    def _child(self, child: str) -> etree._Element:
        found = self.xml.find(child) if child else self.xml
        if found is None:
            raise MistakeError(f"<{self.kind}> without <{child}>", "this form of it has no counterpart", line(self.xml))
        return found

    def _filled(self, element: etree._Element) -> str:
        text = content(element)
        if "%" not in text:
            return text
        arguments = self.arguments
        if arguments is None:
            raise MistakeError("a parameter outside <group> and <slide>", "name the variable")

        def argument(match: re.Match[str]) -> str:
            if match[1] == "...":
                return " ".join(arguments[self.arity :])
            if int(match[1]) >= len(arguments):
                raise MistakeError(f"%{match[1]} of only {len(arguments)} arguments", "add the others to <args>")
            return arguments[int(match[1])]

        return _PARAMETER.sub(argument, text)


def slide_scopes(slide: etree._Element, variables: Variables, arity: int) -> Iterator[list[str]]:
    """Yield the arguments of each constraint of a `<slide>`, whose template has `arity` parameters.

    Raises:
        MistakeError: if its attributes are wrong.
    """
    lists = slide.findall("list")
    members = [list(variables.named(content(one))) for one in lists]
    offsets = [_positive(one, "offset", 1) for one in lists]
    collects = [_positive(one, "collect", arity if len(lists) == 1 else 1) for one in lists]
    circular = attribute(slide, "circular") == "true"
    if not lists or (circular and len(lists) > 1):
        raise MistakeError("a slide without one list", "a circular one has one")
    number = 0
    while True:
        starts = [number * offset for offset in offsets]
        if circular:
            fits = starts[0] < len(members[0])
        else:
            fits = all(s + c <= len(m) for s, c, m in zip(starts, collects, members, strict=True))
        if not fits:
            return
        yield [
            some[(start + step) % len(some)]
            for start, collect, some in zip(starts, collects, members, strict=True)
            for step in range(collect)
        ]
        number += 1


def _positive(element: etree._Element, name: str, default: int) -> int:
    word = attribute(element, name)
    if not word:
        return default
    if not word.isdecimal() or not 0 < len(word) < 7 or int(word) == 0:  # noqa: PLR2004 - digits
        raise MistakeError(f'{name}="{shortened(word)}"', "expected a number of 1 or more")
    return int(word)
