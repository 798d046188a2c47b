"""A robot's file without what its schema refuses, so that mistakes of other layers can be reported as well.

Only what nothing else refers to is taken out: attributes, unknown elements, constraints, topics, neighbours. Otherwise
one mistake would be reported several times.
"""

from __future__ import annotations

import re

from lxml import etree
from lxml.etree import _Element

from robochoc.formats.schema import refused_by

_REMOVABLE = {"constraint", "topic", "agent"}
_ROUNDS = 2
"""Without an attribute that was refused, an element may lack one: that is found in a second round."""

_ATTRIBUTE = re.compile(r", attribute '([^']*)'")
_LACKS_ATTRIBUTE = "is required but missing"
_UNEXPECTED = "This element is not expected"
_TEXT = "Character content"


def without_schema_errors(tree: etree._Element, schema: etree.XMLSchema) -> etree._Element | None:
    """Return `tree` without what `schema` refuses. None: that would take away too much. `tree` itself is changed."""
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
    except etree.XPathEvalError:  # a prefix that the file has not declared
        return None
    return found[0] if isinstance(found, list) and len(found) == 1 and isinstance(found[0], _Element) else None


def _repair(element: etree._Element, message: str) -> bool:
    """Take out of `element` what the schema's `message` refuses. Return False where that must stay."""
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
    """Remove `element`, and the count of elements that its parent states."""
    parent = element.getparent()
    if parent is None:
        return False
    parent.remove(element)
    for name in [name for name in map(str, parent.attrib) if name.startswith("nb")]:
        del parent.attrib[name]
    return True
