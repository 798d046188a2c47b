"""Views of XML elements that record which parts were read. An unread part is an error.

`open_xml` is the only way to get a view. When its block ends, the whole tree is checked: each element, attribute and
text that was not read becomes a diagnostic with its line. So a reader cannot overlook a part that it does not support.
"""

# ruff: noqa: SLF001 - a view and the views of its children share one record
from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from lxml import etree

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, encodable, shortened
from robochoc.formats.diagnostics import suggestion as suggested_name
from robochoc.formats.xml import BLANKS, line, read_tree

MAX_DEPTH = 40
"""The maximum depth of elements, so that readers that recurse through views cannot overflow Python's stack."""

_ABOUT_THE_DOCUMENT = ("{http://www.w3.org/2001/XMLSchema-instance}", "{http://www.w3.org/XML/1998/namespace}")
"""Namespaces of attributes that describe the XML document, not its contents: `xsi:schemaLocation`, `xml:id`."""


@contextmanager
def open_xml(path: Path, most: int, *, long_texts: bool = False) -> Iterator[ElementView]:
    """Provide a view of the root element of the XML file `path`, which may have at most `most` bytes.

    Args:
        path: The file. Its contents are not trusted.
        most: The maximum size of the file, in bytes.
        long_texts: True if a text may have more than 10 million characters.

    Raises:
        InvalidInputError: if the file is not valid XML; or, when the block ends, with every error reported in it, or
            with every part that was not read in it.
    """
    report = DiagnosticCollector(encodable(str(path)))
    with viewing(read_tree(path, most, long_texts=long_texts), report) as root:
        yield root


@contextmanager
def viewing(element: etree._Element, report: DiagnosticCollector) -> Iterator[ElementView]:
    """Provide a view of `element`, the root of a tree in memory. See `open_xml`."""
    root = ElementView(element, report)
    with root.guard():
        yield root
    root._report_unread()
    report.finish()


class ElementView:
    """A view of one element in an XML document. Parts of the element count as read after they were requested.

    Attributes:
        tag: The name of the element.
        line: The line where the element starts.
        report: Collects the errors in the document.
    """

    __slots__ = ("_asked", "_asked_attributes", "_children", "_depth", "_element", "_is_read", "_is_text_read",
                 "_is_unchecked", "line", "report", "tag")  # fmt: skip

    def __init__(self, element: etree._Element, report: DiagnosticCollector, depth: int = 1) -> None:
        self._element = element
        self._depth = depth
        self._children: list[ElementView] | None = None
        self._is_read = depth == 1
        self._is_text_read = False
        self._is_unchecked = False
        self._asked: set[str] = set()
        self._asked_attributes: set[str] = set()
        self.tag: str = element.tag
        self.line = line(element)
        self.report = report

    # Attributes

    def attribute(self, name: str) -> str:
        """Return the text of an attribute, stripped of blanks; empty if the attribute is missing."""
        self._asked_attributes.add(name)
        return (self._element.get(name) or "").strip(BLANKS)

    def ignore_attributes(self, *names: str) -> None:
        """Ignore attributes that have no meaning here."""
        self._asked_attributes.update(names)

    # Text

    def text(self) -> str:
        """Return the text of an element. Raises `MistakeError` if it has child elements."""
        for child in self._element:
            raise MistakeError(
                f"<{child.tag}> is not allowed inside <{self.tag}>", "write only text there", line(child)
            )
        self._is_text_read = True
        return (self._element.text or "").strip(BLANKS)

    def mixed(self) -> Iterator[str | ElementView]:
        """Yield texts and child elements in document order, for an element that has both. All of them count as read."""
        self._is_text_read = True
        yield self._element.text or ""
        for child in self._views():
            child._is_read = True
            yield child
            yield child._element.tail or ""

    def all_text(self) -> str:
        """Return the text of the element and of all its descendants. The text does not count as read."""
        return "".join(str(part) for part in self._element.itertext())

    # Child elements

    @property
    def has_children(self) -> bool:
        """True if there are child elements."""
        return len(self._element) > 0

    def has(self, name: str) -> bool:
        """Return whether there is a child element called `name`. The child does not count as read."""
        self._asked.add(name)
        return self._element.find(name) is not None

    def child(self, name: str) -> ElementView | None:
        """Return the child element called `name`, or None. Raises `MistakeError` if there are several."""
        found = self.children(name)
        if len(found) > 1:
            raise found[1].mistake(f"<{self.tag}> has a second <{name}>", "keep one of them")
        return found[0] if found else None

    def required(self, name: str) -> ElementView:
        """Return the child element called `name`. Raises `MistakeError` unless there is exactly one."""
        found = self.child(name)
        if found is None:
            unread = [child.tag for child in self._views() if not child._is_read and child.tag not in self._asked]
            raise self.mistake(f"<{self.tag}> has no <{name}>", _hint_on_missing(name, unread))
        return found

    def one_of(self, *names: str) -> ElementView:
        """Return the only child element with one of the `names`. Raises `MistakeError` unless there is exactly one."""
        found = self.children(*names)
        if len(found) == 1:
            return found[0]
        for child in found[1:]:
            raise child.mistake(f"<{self.tag}> has a second element, <{child.tag}>", "keep one of them")
        for child in self._views():
            if not child._is_read:
                raise self._unread_element(child)
        raise self.mistake(f"an element is missing in <{self.tag}>", suggested_name("", names, "elements"))

    def children(self, *names: str) -> list[ElementView]:
        """Return the child elements with these `names`, in document order."""
        self._asked.update(names)
        found = [child for child in self._views() if child.tag in names]
        for child in found:
            child._is_read = True
        return found

    def ignore(self, *names: str) -> None:
        """Ignore child elements with these `names`, including their contents."""
        for child in self.children(*names):
            child._is_unchecked = True

    # Errors

    def mistake(self, message: str, hint: str) -> MistakeError:
        """Return an error in this element."""
        return MistakeError(message, hint, self.line)

    @contextmanager
    def guard(self) -> Iterator[None]:
        """Report a `MistakeError` raised inside, and continue after the block.

        Parts of this element that were not read because of the error are not reported.
        """
        try:
            yield
        except MistakeError as mistake:
            self._is_unchecked = True
            self.report.add(mistake.line or self.line, mistake.message, mistake.hint)

    # Private

    def _views(self) -> list[ElementView]:
        """Return views of all child elements. Raises `MistakeError` if elements are nested too deeply."""
        if self._children is None:
            if self._depth == MAX_DEPTH and len(self._element):
                raise self.mistake(f"elements are nested deeper than {MAX_DEPTH} levels", "use fewer levels")
            self._children = [ElementView(child, self.report, self._depth + 1) for child in self._element]
        return self._children

    def _attributes(self) -> list[str]:
        """Return the names of the attributes that belong to the contents of the document."""
        return [str(name) for name in self._element.attrib if not str(name).startswith(_ABOUT_THE_DOCUMENT)]

    def _report_unread(self) -> None:
        """Add a diagnostic for each part of the tree that was not read."""
        waiting = [self]
        while waiting:
            view = waiting.pop()
            if view._is_unchecked:
                continue
            with view.guard():
                for child in view._views():
                    if child._is_read:
                        waiting.append(child)
                    else:
                        with child.guard():
                            raise view._unread_element(child)
            for name in view._attributes():
                if name not in view._asked_attributes:
                    message = f"the attribute '{shortened(name)}' is not supported in <{view.tag}>"
                    self.report.add(view.line, message, view._hint(name, view._asked_attributes, "attributes"))
            if not view._is_text_read:
                view._report_text()

    def _unread_element(self, child: ElementView) -> MistakeError:
        hint = self._hint(child.tag, self._asked, "elements")
        return child.mistake(f"<{shortened(child.tag)}> is not supported in <{self.tag}>", hint)

    def _hint(self, name: str, asked: set[str], what: str) -> str:
        if name in asked:
            return f"it is not supported together with the other parts of this <{self.tag}>"
        return suggested_name(name, sorted(asked), f"{what} of <{self.tag}>") if asked else "delete it"

    def _report_text(self) -> None:
        for number, text in [
            (self.line, self._element.text),
            *((line(child), child.tail) for child in self._element),
        ]:
            if text and text.strip(BLANKS):
                shown = shortened(" ".join(text.split()))
                self.report.add(
                    number, f"<{self.tag}> contains the text '{shown}'", "delete it: only elements are expected there"
                )


def _hint_on_missing(name: str, unread: Sequence[str]) -> str:
    hint = suggested_name(name, unread, "parts") if unread else ""
    if hint.startswith("did you mean"):
        similar = hint.removeprefix("did you mean '").removesuffix("'?")
        return f"write '{name}' instead of '{shortened(similar)}'"
    return f"add it; found: {shortened(' '.join(unread))}" if unread else "add it"
