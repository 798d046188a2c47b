"""The names of the options of a run in Python, for messages that name those of the command line.

The layers below know one name of each option, that of `robochoc solve`. `in_python` is applied where a message leaves
for a user of the library: "add --runtime simulator" becomes "add runtime='simulator'".
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager

from robochoc.system.errors import RobochocError

_ARGUMENTS = {
    "set": "settings",
    "spare": "spares",
    "with": "central_with",
    "filter": "filters",
    "local-solutions": "local",
    "local-timeout": "local",
    "no-cache": "cache",
}
"""Options whose argument in Python has another name; of all others it is the option's, with underscores."""
_WORDS = {
    "runtime": "processes|simulator|network|arrays",
    "schedule": "concurrent|one-by-one|cycles|random",
    "withdraw": "minimum|maximal",
    "on-loss": "fail|withdraw",
    "preprocess": "ac",
    "order": "dom-deg|max-degree|dfs|given",
    "with": "ace|ortools",
    "protocol": r"[a-z][a-z0-9-]*",
    "set": r"\w+=\S+",
}
"""The words after an option that are its value. Others continue the sentence."""
_NUMBER = re.compile(r"[\d.]+(e[+-]?\d+)?|[A-Z]+")
"""A number, or a placeholder for one."""
_ADJACENT = re.compile(r"(=(?:'[^']*'|\{[^}]*\}|\d+)) (?=[a-z_]+=)")
_OPTION = re.compile(r"(?<![\w-])--(?P<name>[a-z][a-z-]*)(?:[ =](?P<value>[\w=+-]+(?:\.\w+)*))?")


def in_python(text: str, arguments: Collection[str]) -> str:
    """Return `text` with the options of `robochoc solve` in it as arguments in Python.

    Args:
        text: A message.
        arguments: The names of the arguments. Options without one are not changed.
    """

    def argument(found: re.Match[str]) -> str:
        name, value = found["name"], found["value"]
        renamed = _ARGUMENTS.get(name, name.replace("-", "_"))
        if renamed not in arguments:
            return found[0]
        if value is None:
            return renamed
        if name == "set" and re.fullmatch(_WORDS["set"], value):
            setting, _, given = value.partition("=")
            return f"{renamed}={{{setting!r}: {given if _NUMBER.fullmatch(given) else repr(given)}}}"
        if re.fullmatch(_WORDS.get(name, "-"), value):
            return f"{renamed}={value!r}"
        return f"{renamed}={value}" if _NUMBER.fullmatch(value) else f"{renamed} {value}"

    return _ADJACENT.sub(r"\1, ", _OPTION.sub(argument, text))


@contextmanager
def errors_in_python(arguments: Collection[str]) -> Iterator[None]:
    """Give the exceptions of robochoc raised inside the context a text with arguments in Python."""
    try:
        yield
    except RobochocError as error:
        error.args = tuple(in_python(one, arguments) if isinstance(one, str) else one for one in error.args)
        raise
