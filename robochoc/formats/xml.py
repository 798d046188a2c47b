"""Read untrusted XML files. They must be well-formed, and valid against their schema.

There are no entities, no DTD and no network access, the size is limited, and only regular files are read.
"""

from __future__ import annotations

import os
import re
import stat
from pathlib import Path
from typing import cast

from lxml import etree

from robochoc.formats.diagnostics import MAX_PER_FILE, Diagnostic, InvalidInputError
from robochoc.formats.schema import check_schema, entries, schema_for

MAX_BYTES = 16 * 1024 * 1024
_SMALL = 64 * 1024
_CHUNK = 1024
_BLOCK = 64 * 1024

BLANKS = " \t\r\n"
"""The characters that count as blanks in XML."""
_DOCTYPE = re.compile(rb"(?>\xef\xbb\xbf)?(?>[ \t\r\n]|<\?.*?\?>|<!--.*?-->)*+<!DOCTYPE", re.DOTALL)
_HINTS = {
    etree.ErrorTypes.ERR_ATTRIBUTE_NOT_STARTED: 'write name="value"',
    etree.ErrorTypes.ERR_ATTRIBUTE_REDEFINED: "write each attribute of an element once",
    etree.ErrorTypes.ERR_ATTRIBUTE_WITHOUT_VALUE: 'write name="value"',
    etree.ErrorTypes.ERR_DOCUMENT_EMPTY: "start the XML file with <",
    etree.ErrorTypes.ERR_DOCUMENT_END: "write one root element that contains everything",
    etree.ErrorTypes.ERR_ENTITYREF_SEMICOL_MISSING: "write &amp; for the character &",
    etree.ErrorTypes.ERR_GT_REQUIRED: "end the tag with >; is the file complete?",
    etree.ErrorTypes.ERR_LT_IN_ATTRIBUTE: "is the quote before it missing? Write &lt; for the character <",
    etree.ErrorTypes.ERR_NAME_REQUIRED: "end the tag with >; write &lt; and &amp; for the characters < and &",
    etree.ErrorTypes.ERR_RESOURCE_LIMIT: "a robot's file has few levels and short texts",
    etree.ErrorTypes.ERR_SPACE_REQUIRED: "end the tag with >",
    etree.ErrorTypes.ERR_TAG_NAME_MISMATCH: "close every element by its own end tag",
    etree.ErrorTypes.ERR_TAG_NOT_FINISHED: "close every element by its own end tag; is the file complete?",
    etree.ErrorTypes.ERR_UNDECLARED_ENTITY: "write the character itself: only &lt; &gt; &amp; &quot; &apos; are known",
}
"""Hints for libxml2's frequent messages."""


def read_xml(path: Path, root: str) -> etree._Element:
    """Return the root element of the XML file `path`. It must be a `root` element, valid against its schema.

    Raises:
        InvalidInputError: if the file is not well-formed, or with all errors found by its schema.
    """
    try:
        content = _bytes(path, MAX_BYTES)
    except OSError as error:
        raise _unreadable(path, error) from None
    return parsed_xml(content, path, root)


def read_tree(path: Path, most: int, *, long_texts: bool = False) -> etree._Element:
    """Return the root element of any XML file of at most `most` bytes. Raises `InvalidInputError`, like `read_xml`.

    With `long_texts`, a text may have more than libxml2's usual limit of 10 million characters.
    """
    try:
        content = _bytes(path, most)
    except OSError as error:
        raise _unreadable(path, error) from None
    return parsed_tree(content, path, most, long_texts=long_texts)


def parsed_xml(content: bytes, path: Path, root: str) -> etree._Element:
    """Return the root element of the untrusted `content`, like `read_xml` for a file at `path`."""
    tree = parsed_tree(content, path, MAX_BYTES)
    if tree.tag != root:
        what = f"the root element is <{etree.QName(tree).localname}>"
        if tree.tag.endswith(f"}}{root}"):
            what = f"<{root}> is in an XML namespace"
        raise _invalid(path, line(tree), what, f"expected <{root}>, without any xmlns")
    schema = schema_for(root)
    if len(content) > _SMALL:
        tree = _with_few_mistakes(tree, content, schema)
    check_schema(tree, str(path), schema)
    return tree


def parsed_tree(content: bytes, path: Path, most: int, *, long_texts: bool = False) -> etree._Element:
    """Return the root element of the untrusted `content`, without entities and DTD, of at most `most` bytes.

    Raises:
        InvalidInputError: if the content is invalid. Messages use `path`.
    """
    _check_text(content, path, most)
    doctype = _DOCTYPE.match(content)
    if doctype:
        raise _invalid(path, doctype[0].count(b"\n") + 1, "a DOCTYPE is not accepted", "delete it, and every entity")
    parser = _parser(long_texts=long_texts)
    try:
        return etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise _malformed(path, error, parser) from None


def attribute(element: etree._Element, name: str) -> str:
    """Return the text of an attribute, stripped of blanks; empty if the attribute is missing."""
    given = element.get(name)
    return given.strip(BLANKS) if given else ""


def line(element: etree._Element) -> int:
    """Return the line of `element` in its file."""
    return cast("int | None", element.sourceline) or 0


def _parser(
    schema: etree.XMLSchema | None = None, *, recover: bool = False, long_texts: bool = False
) -> etree.XMLParser:
    """Return a parser that ignores comments and processing instructions, and always reads UTF-8."""
    return etree.XMLParser(
        encoding="utf-8",
        resolve_entities=False,
        load_dtd=False,
        no_network=True,
        huge_tree=long_texts,
        remove_comments=True,
        remove_pis=True,
        recover=recover,
        schema=schema,
    )


def _with_few_mistakes(tree: etree._Element, content: bytes, schema: etree.XMLSchema) -> etree._Element:
    """Return `tree`, truncated after the last error that will be reported.

    For each error, lxml counts the preceding siblings, which takes hours for a million errors. A parser that validates
    while it reads is fast, but has no line numbers, so it is used only to find where to truncate.
    """
    counting = _parser(schema)
    for start in range(0, len(content), _CHUNK):
        counting.feed(content[start : start + _CHUNK])
        if len(entries(counting.feed_error_log)) > MAX_PER_FILE:
            return etree.fromstring(content[: start + _CHUNK], _parser(recover=True))
    return tree


def _check_text(content: bytes, path: Path, most: int) -> None:
    """Raise `InvalidInputError` unless `content` is UTF-8, not empty, and within the limit."""
    if len(content) > most:
        raise _invalid(path, 0, f"is larger than {most // 2**20} MiB", "split it: a robot's file has a few kB")
    if not content.strip():
        raise _invalid(path, 0, "is empty", "see 'robochoc generate' for examples")
    try:
        content.decode()
    except UnicodeDecodeError as error:
        number = content.count(b"\n", 0, error.start) + 1
        raise _invalid(path, number, "is not UTF-8", "save it in UTF-8") from None


def _bytes(path: Path, most: int) -> bytes:
    """Return at most one byte more than allowed. A FIFO is opened without waiting for its writer, and rejected."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise _invalid(path, 0, "is not a regular file", "move it away: each .xml here must be an XML file")
        content = os.read(descriptor, min(status.st_size, most) + 1)
        while content and len(content) <= most and (more := os.read(descriptor, _BLOCK)):
            content += more
        return content[: most + 1]
    finally:
        os.close(descriptor)


def _malformed(path: Path, error: etree.XMLSyntaxError, parser: etree.XMLParser) -> InvalidInputError:
    """Return the first of the parser's messages as a diagnostic. The other messages are consequences of it."""
    for first in entries(parser.error_log):
        what = re.split(r", (?:use|try) XML_PARSE_HUGE", first.message.strip())[0]
        return _invalid(
            path, first.line, f"is not well-formed XML: {what}", _HINTS.get(first.type, "correct the XML there")
        )
    return _invalid(path, 0, f"is not well-formed XML: {error}", "correct the XML")


def _unreadable(path: Path, error: OSError) -> InvalidInputError:
    return _invalid(path, 0, f"cannot be read: {error.strerror}", "check the path and its permissions")


def _invalid(path: Path, number: int, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(str(path), number, message, hint)])
