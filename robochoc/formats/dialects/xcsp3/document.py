"""An XCSP3 file as a tree that nothing can hide in: no entities, no DTD, no network, bounded depth and size.

pycsp3 has a parser of its own. It is not used here: it reads entities, knows no lines, answers a kind that it has not
by a failing `assert`, drops tuples, and patches built-in types for the whole process. The tests hold this reader
against it, and against ACE, which reads the files itself.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import cast

from lxml import etree

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, MistakeError, encodable
from robochoc.formats.dialects.dialect import MAX_FILE

MAX_DEPTH = 40
"""The maximum depth of elements."""

_ROOT = re.compile(rb"<instance\b[^>]*\bformat\s*=\s*[\"']\s*XCSP3\s*[\"']")
_DOCTYPE = re.compile(rb"<!DOCTYPE", re.IGNORECASE)


def recognises(path: Path, beginning: bytes) -> bool:  # noqa: ARG001 - as all dialects do
    """Return whether a file that begins so is an XCSP3 instance."""
    return _ROOT.search(beginning) is not None


def read_document(path: Path) -> etree._Element:
    """Return the root element of an XCSP3 file.

    Raises:
        InvalidInputError: if it cannot be read, is no XML, or has what makes XML dangerous.
    """
    data = _content(path)
    doctype = _DOCTYPE.search(data)
    if doctype:
        number = data.count(b"\n", 0, doctype.start()) + 1
        raise invalid(path, number, "a DOCTYPE is not accepted", "delete it, and every entity")
    try:
        data.decode()
    except UnicodeDecodeError as error:  # another encoding might hide a DOCTYPE
        number = data.count(b"\n", 0, error.start) + 1
        raise invalid(path, number, "is not UTF-8", "save it in UTF-8") from None
    parser = etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=True,  # tables are long texts; the depth is looked at below, and there are no entities
        remove_comments=True,
        remove_pis=True,
    )
    try:
        root = etree.fromstring(data, parser)
    except etree.XMLSyntaxError as error:
        what = f"is not well-formed XML: {error.msg}"
        raise invalid(path, error.lineno or 0, what, "mend the XML there") from None
    _check(root, path)
    return root


def line(element: etree._Element) -> int:
    """Return where `element` stands in its file."""
    return cast("int | None", element.sourceline) or 0


def content(element: etree._Element) -> str:
    """Return the text of an element without children.

    Raises:
        MistakeError: if it has any.
    """
    if len(element):
        raise MistakeError(
            f"<{element[0].tag}> inside <{element.tag}>", "only its text is expected there", line(element)
        )
    return (element.text or "").strip()


def attribute(element: etree._Element, name: str) -> str:
    """Return an attribute's text without blanks around it; empty where it is left out."""
    return (element.get(name) or "").strip()


def invalid(path: Path, number: int, message: str, hint: str) -> InvalidInputError:
    """Return one mistake in a file as an error."""
    return InvalidInputError([Diagnostic(encodable(str(path)), number, message, hint)])


def _content(path: Path) -> bytes:
    """Return the bytes of a regular file, which is not too large. A FIFO is not waited for."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            os.close(descriptor)
            raise invalid(path, 0, "is not a regular file", "name an XCSP3 file")
        with os.fdopen(descriptor, "rb") as file:
            found = file.read(MAX_FILE + 1)
    except OSError as error:
        raise invalid(path, 0, f"cannot be read: {error.strerror}", "check the path and its permissions") from None
    if len(found) > MAX_FILE:
        raise invalid(path, 0, f"is larger than {MAX_FILE // 2**20} MiB", "import a smaller problem")
    return found


def _check(root: etree._Element, path: Path) -> None:
    """Raise `InvalidInputError` unless `root` is an XCSP3 instance of a kind that is read here."""
    if root.tag != "instance" or attribute(root, "format") != "XCSP3":
        raise invalid(path, line(root), "is no XCSP3 file", 'expected <instance format="XCSP3" type="CSP">')
    kind = attribute(root, "type")
    if kind not in {"CSP", "COP"}:
        raise invalid(path, line(root), f'type="{kind[:40]}" of XCSP3 is not supported', "CSP and COP are")
    waiting = [(root, 1)]
    while waiting:
        element, depth = waiting.pop()
        if depth > MAX_DEPTH or not isinstance(element.tag, str):
            what = "an entity" if depth <= MAX_DEPTH else f"elements nested deeper than {MAX_DEPTH} levels"
            raise invalid(path, line(element), what, "no XCSP3 file needs that")
        waiting += [(child, depth + 1) for child in element]
