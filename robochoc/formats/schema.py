"""Validate XML files against their XSD schemas, and report libxml2's messages in plain words."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from threading import Lock
from typing import Any, Protocol, cast

from lxml import etree
from lxml.etree import _Element

from robochoc.formats.diagnostics import Diagnostic, DiagnosticCollector, InvalidInputError, shortened

_LIBXML2 = Lock()
"""The lock for every use of a schema, because robots on one machine may read their files in threads.

libxml2 initialises the types of all schemas while it compiles the first schema, and two threads at a time would corrupt
memory. Besides, in lxml a schema has a single error log for all threads.
"""
_SCHEMAS = {"instance": "robot.xsd", "scenario": "scenario.xsd"}
_OPTIONAL = {"random_variables", "topics", "relations", "predicates", "functions", "constraints"}
"""The optional elements among those that libxml2 lists when an element is missing."""

_PARTS = (
    re.compile(r"Element '(?P<element>[^']*)'(?:, attribute '(?P<attribute>[^']*)')?: "),
    re.compile(r"The attribute '(?P<missing>[^']*)' is required but missing"),
    re.compile(
        r"(?s)The value '(?P<value>.*)' is not (?:an element of the set|accepted by the pattern) (?P<rule>.*)\.$"
    ),
    re.compile(r"(?s): '(?P<value>.*)' is not a valid value of the atomic type (?P<rule>'[^']*')\.$"),
    re.compile(r"(?s)The value '(?P<value>.*)' is greater than the maximum value allowed \((?P<rule>'[^']*')\)\.$"),
    re.compile(r"Expected is (?:one of )?\( (?P<expected>.*) \)\.$"),
)
"""The parts of libxml2's messages."""

_PHRASES = (
    ("[duplicate]", "there is a second <{element}>", "only one is allowed: merge the two"),
    ("This element is not expected. Expected", "<{element}> does not belong in <{parent}>", "expected {expected}"),
    ("This element is not expected", "<{element}> does not belong in <{parent}>", "correct its spelling or delete it"),
    ("Missing child element", "<{element}> lacks {lacking}", "add it, even if it is empty"),
    ("is required but missing", "<{element}> lacks its attribute '{missing}'", 'write <{element} {missing}="...">'),
    ("' is not allowed.", "<{element}> has no attribute '{attribute}'", "correct its spelling or delete it"),
    ("[facet", '{attribute}="{value}" in <{element}> is not allowed', "expected {rule}"),
    ("is not a valid value of", '{attribute}="{value}" in <{element}> is not allowed', "expected {rule}"),
    ("Element content is not allowed", "<{element}> contains an element, but only text is allowed there", "delete it"),
    ("Character content", "<{element}> contains text, but only elements are allowed there", "delete it"),
    ("", "{message}", "see the schemas in xsd/"),
)
"""A part of libxml2's message, the message in plain words, and a suggestion. The first match counts."""

_PATTERNS = {
    "'[A-Za-z][A-Za-z0-9_.]*'": "a name: a letter, then letters, digits, '.' and '_'",
    r"'\S+'": "a name without blanks",
    "'[0-9]{1,18}'": "a number of at most 18 digits, 0 or more",
    r"'[+\-]?[0-9]{1,18}'": "an integer of at most 18 digits",
    "'weight'": "an integer from 1 to 1000000",
    "'1000000'": "an integer from 1 to 1000000",
    "'solved|[0-9]{1,18} messages'": "'solved', or a number and 'messages': 200 messages",
}


class SchemaError(InvalidInputError):
    """Raised for an XML file that its schema refuses. The file may also have other errors.

    Attributes:
        tree: The parsed file.
    """

    def __init__(self, diagnostics: Iterable[Diagnostic], tree: etree._Element) -> None:
        super().__init__(diagnostics)
        self.tree = tree

    def __getstate__(self) -> dict[str, object]:
        return {**vars(self), "tree": etree.tostring(self.tree)}

    def __setstate__(self, state: dict[str, Any] | None) -> None:
        super().__setstate__(state)
        self.tree = etree.fromstring(cast("bytes", self.tree), etree.XMLParser(resolve_entities=False, no_network=True))


class LogEntry(Protocol):
    """One of libxml2's messages."""

    line: int
    message: str
    path: str | None
    type: int


def entries(error_log: object) -> list[LogEntry]:
    """Return the messages in an lxml `error_log`, which has no type in the stubs."""
    return list(cast("Iterable[LogEntry]", error_log))


@cache
def schema_for(root: str) -> etree.XMLSchema:
    """Return the schema for files with the root element `root`. It is compiled when the first such file is read.

    Schemas are in the package of a wheel, or at the top of a checkout.
    """
    name, here = _SCHEMAS[root], Path(__file__).resolve()
    inside, outside = here.parents[1] / "xsd" / name, here.parents[2] / "xsd" / name
    with _LIBXML2:
        return etree.XMLSchema(file=str(inside if inside.is_file() else outside))


def refused_by(schema: etree.XMLSchema, tree: etree._Element) -> list[LogEntry]:
    """Return the errors that `schema` finds in `tree`; empty if it is valid."""
    with _LIBXML2:
        return [] if schema.validate(tree) else entries(schema.error_log)


def check_schema(tree: etree._Element, file: str, schema: etree.XMLSchema) -> None:
    """Raise `SchemaError` unless `tree`, read from `file`, is valid."""
    refused = refused_by(schema, tree)
    if not refused:
        return
    import difflib  # noqa: PLC0415 - start-up: only mistakes need it

    report = DiagnosticCollector(file)
    unknown: dict[str | None, list[str]] = {}
    for entry in refused:
        parts = _parts(entry)
        if difflib.get_close_matches(parts["missing"], unknown.get(entry.path, [])):
            continue  # one misspelt attribute is one error: `typ` is unknown, and therefore `type` is missing
        if parts["attribute"]:
            unknown.setdefault(entry.path, []).append(parts["attribute"])
        message, hint = next(phrase for sign, *phrase in _PHRASES if sign in parts["message"])
        report.add(entry.line, message.format_map(parts), hint.format_map(parts))
    try:
        report.finish()
    except InvalidInputError as invalid:
        raise SchemaError(invalid.diagnostics, tree) from None


def _parts(entry: LogEntry) -> dict[str, str]:
    """Return the parts of one message, by the names that the phrases use."""
    parts = dict.fromkeys(("element", "attribute", "missing", "value", "rule", "expected"), "")
    for part in _PARTS:
        found = part.search(entry.message)
        parts |= {name: text or "" for name, text in found.groupdict().items()} if found else {}
    children = parts["expected"].split(", ")
    path = entry.path or ""
    again = parts["element"] not in children and re.search(r"\[(?!1\])\d+\]$", path)
    required = [name for name in children if name not in _OPTIONAL] or children
    return {
        **parts,
        "message": f"[duplicate] {entry.message}" if again and "not expected" in entry.message else entry.message,
        "parent": re.sub(r"\[\d+\]", "", path).rpartition("/")[0].rpartition("/")[2],
        "value": shortened(parts["value"]),
        "rule": _PATTERNS.get(parts["rule"], f"one of {parts['rule'].strip('{}')}"),
        "expected": " or ".join(f"<{name}>" for name in children),
        "lacking": " and ".join(f"<{name}>" for name in required),
    }


# Removing invalid parts

_REMOVABLE = {"constraint", "topic", "agent"}
_ROUNDS = 2
"""The number of rounds. The second round finds attributes that are missing after a misspelt one was removed."""

_ATTRIBUTE = re.compile(r", attribute '([^']*)'")
_LACKS_ATTRIBUTE = "is required but missing"
_UNEXPECTED = "This element is not expected"
_TEXT = "Character content"


def without_schema_errors(tree: etree._Element, schema: etree.XMLSchema) -> etree._Element | None:
    """Remove the invalid parts of `tree` and return it, or return None if too much would have to be removed.

    Only parts to which nothing else refers are removed: attributes, unknown elements, constraints, topics, neighbours.
    Otherwise one error would be reported several times. The removal lets other layers report their errors as well.
    """
    for _ in range(_ROUNDS):
        mistakes = refused_by(schema, tree)
        if not mistakes:
            return tree
        document = tree.getroottree()
        refused = [(_element(document, mistake.path), mistake.message) for mistake in mistakes]
        if not all(element is not None and _repair(element, message) for element, message in refused):
            return None
    return None if refused_by(schema, tree) else tree


def _element(document: etree._ElementTree, path: str | None) -> etree._Element | None:
    try:
        found = document.xpath(path) if path else []
    except etree.XPathEvalError:  # the file has not declared this prefix
        return None
    return found[0] if isinstance(found, list) and len(found) == 1 and isinstance(found[0], _Element) else None


def _repair(element: etree._Element, message: str) -> bool:
    """Remove the part of `element` named in the schema's `message`. Return False if it cannot be removed."""
    attribute = _ATTRIBUTE.search(message)
    if attribute:
        element.attrib.pop(attribute[1], "")
    elif _LACKS_ATTRIBUTE in message:
        return element.tag in _REMOVABLE and _remove(element)
    elif _UNEXPECTED in message:
        return _remove(element)
    elif _TEXT in message:
        element.text = None
        for child in element:
            child.tail = None
    else:
        return False
    return True


def _remove(element: etree._Element) -> bool:
    """Remove `element`, and the element count stated by its parent."""
    parent = element.getparent()
    if parent is None:
        return False
    parent.remove(element)
    for name in [name for name in map(str, parent.attrib) if name.startswith("nb")]:
        del parent.attrib[name]
    return True
