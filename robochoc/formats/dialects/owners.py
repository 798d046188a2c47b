"""Variables of tools that know no owners, as variables of robots."""

from __future__ import annotations

import re
from collections.abc import Iterable

from robochoc.formats.diagnostics import MistakeError, shortened


def owners_by(pattern: str, names: Iterable[str]) -> dict[str, str]:
    """Return the owner of each of `names`: what `pattern` finds in it, its first group or all of its match.

    Raises:
        MistakeError: if `pattern` is no regular expression, or finds nothing in a name.
    """
    try:
        expression = re.compile(pattern)
    except re.error as error:
        what = f"the owner '{shortened(pattern)}' is no regular expression: {error}"
        raise MistakeError(what, "mend it") from None
    owners = {}
    for name in names:
        match = expression.search(name)
        if match is None:
            what = f"the owner '{shortened(pattern)}' finds nothing in the variable '{shortened(name)}'"
            raise MistakeError(what, "let it find something in every variable's name")
        owners[name] = match[1] if expression.groups and match[1] else match[0]
    return owners
