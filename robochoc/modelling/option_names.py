"""Python names for the options of a run, so that messages suit users of the library.

Lower layers know only the option names of `robochoc solve`. `in_python` converts a message before a user of the library
sees it: "add --runtime simulator" becomes "add runtime='simulator'".
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace

from robochoc.formats.diagnostics import InvalidInputError
from robochoc.system.errors import RobochocError

_ARGUMENTS = {
    "set": "settings",
    "spare": "spares",
    "with": "central_with",
    "filter": "filters",
    "local-solutions": "local",
    "local-timeout": "local",
    "no-cache": "cache",
    "host": "hosts",
}
"""Options whose Python argument has another name. All other arguments have the option's name, with underscores."""
_FLAGS = {"allow-code": "allow_code=True", "cold": "cold=True"}
"""Options without a value that a message tells the user to add."""
_WORDS = {
    "runtime": "processes|simulator|network|arrays",
    "schedule": "concurrent|one-by-one|cycles|random",
    "withdraw": "minimum|maximal",
    "on-loss": "fail|withdraw",
    "preprocess": "ac",
    "answer": "best|final",
    "risk": "expected|worst",
    "order": "dom-deg|max-degree|dfs|given",
    "with": "ace|ortools",
    "protocol": r"[a-z][a-z0-9-]*",
    "set": r"\w+=\S+",
    "objectives": "pareto",
}
"""The words that can be the value of the option before them. Other words continue the sentence."""
_NUMBER = re.compile(r"[\d.]+(e[+-]?\d+)?|[A-Z]+")
"""A number, or a placeholder for a number."""
_ADJACENT = re.compile(r"(=(?:'[^']*'|\{[^}]*\}|\d+)) (?=[a-z_]+=)")
_OPTION = re.compile(r"'robochoc [^']*'|(?<![\w-])--(?P<name>[a-z][a-z-]*)(?:[ =](?P<value>[\w=+-]+(?:\.\w+)*))?")


def in_python(text: str, arguments: Collection[str]) -> str:
    """Return `text` with each option of `robochoc solve` replaced by its Python argument.

    Args:
        text: A message.
        arguments: The names of the Python arguments. Options without an argument are not changed.
    """

    def argument(found: re.Match[str]) -> str:
        name, value = found["name"] or "", found["value"]  # no name: a command for the shell
        renamed = _ARGUMENTS.get(name, name.replace("-", "_"))
        if renamed not in arguments:
            return found[0]
        if name in _FLAGS:
            return _FLAGS[name] + found[0].removeprefix(f"--{name}")
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
    """Rewrite the messages of robochoc exceptions raised inside the context with the names of Python arguments."""
    try:
        yield
    except InvalidInputError as error:
        error.diagnostics = tuple(
            replace(one, message=in_python(one.message, arguments), hint=in_python(one.hint, arguments))
            for one in error.diagnostics
        )
        error.args = ("\n".join(map(str, error.diagnostics)),)
        raise
    except RobochocError as error:
        error.args = tuple(in_python(one, arguments) if isinstance(one, str) else one for one in error.args)
        raise
