"""Docstrings as the site needs them: examples (`>>>`) as blocks of code, protocols without their first line.

Markdown takes examples for quotations of quotations. The first line of a protocol's module is its page's heading.

An extension of griffe, which reads the docstrings for the site (https://mkdocstrings.github.io/griffe/extensions/).
"""

from __future__ import annotations

import re
from typing import Any

from griffe import Extension, Object

_EXAMPLE = re.compile(r"(?:^ *>>> .*\n?)(?:^ *\S.*\n?)*", re.MULTILINE)


class Doctests(Extension):
    """Fences the examples of every docstring, and leaves out what is a heading already."""

    def on_object(self, *, obj: Object, **_: Any) -> None:  # noqa: ANN401 - griffe's
        """Change the docstring of one object."""
        if obj.docstring and ">>> " in obj.docstring.value:
            obj.docstring.value = _EXAMPLE.sub(_fenced, obj.docstring.value)
        if obj.docstring and obj.is_module and obj.path.startswith("robochoc.protocols."):
            obj.docstring.value = obj.docstring.value.partition("\n\n")[2]


def _fenced(example: re.Match[str]) -> str:
    lines = example[0].rstrip().splitlines()
    indent = min(len(line) - len(line.lstrip()) for line in lines)
    return "\n".join(["```pycon", *(line[indent:] for line in lines), "```", ""])
