"""The root element of an XCSP3 instance, and attributes that do not concern the problem.

docs/explanation/design/files.md explains why pycsp3's parser is not used here.
"""

from __future__ import annotations

import re
from pathlib import Path

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.element_view import ElementView

_ROOT = re.compile(rb"<instance\b[^>]*\bformat\s*=\s*[\"']\s*XCSP3\s*[\"']")


def recognises(path: Path, beginning: bytes) -> bool:  # noqa: ARG001 - as all dialects do
    """Return whether a file is an XCSP3 instance, by its first bytes."""
    return _ROOT.search(beginning) is not None


def check_root(root: ElementView) -> None:
    """Raise `MistakeError` unless `root` is an XCSP3 instance of a supported type."""
    if root.tag != "instance" or root.attribute("format") != "XCSP3":
        raise root.mistake("is not a valid XCSP3 file", 'expected <instance format="XCSP3" type="CSP">')
    kind = root.attribute("type")
    if kind not in {"CSP", "COP"}:
        raise root.mistake(f'type="{shortened(kind)}" of XCSP3 is not supported', 'write type="CSP" or type="COP"')
    ignore_remarks(root)


def ignore_remarks(view: ElementView) -> None:
    """Ignore attributes with remarks for people and other programs."""
    view.ignore_attributes("id", "class", "note")


def flag(view: ElementView, name: str, *, default: bool = False) -> bool:
    """Return the truth value of an attribute. Raises `MistakeError`."""
    word = view.attribute(name)
    if word not in {"", "true", "false"}:
        raise MistakeError(f'{name}="{shortened(word)}" is not valid', "write true or false", view.line)
    return default if not word else word == "true"
