"""The public Python names with their signatures, one on each line.

python -m tests.support.public_api > tests/repository/public_api.txt
"""

from __future__ import annotations

import argparse
import importlib
import inspect
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass

STABLE = ("robochoc", "robochoc.run", "robochoc.protocols", "robochoc.testing", "robochoc.journal")
"""The modules whose `__all__` is stable (docs/reference/stability.md)."""


PRIVATE = {
    *("Model.add_robot", "Model.add_variable", "Model.changed", "Model.free_prefix", "Model.rule", "Model.rules"),
    *("Model.objective", "Outcome.assignment_parts", "Outcome.parts", "Solution.assignment_parts", "Solution.parts"),
    "Solution.of",
}
"""Members that other modules of robochoc use; they are not on the API page."""


def public_api() -> Iterator[str]:
    """Yield each public name of the stable modules, with its parameters; of classes also the public members."""
    for module in STABLE:
        loaded = importlib.import_module(module)
        for name in sorted(loaded.__all__):
            yield from _lines(f"{module}.{name}", getattr(loaded, name))


def _lines(name: str, value: object) -> Iterator[str]:
    if inspect.ismodule(value) or name.endswith("__version__"):
        yield name
    elif inspect.isclass(value):
        bases = ", ".join(base.__name__ for base in value.__bases__ if base is not object)
        yield f"class {name}({bases})"
        if is_dataclass(value):
            yield from (f"{name}.{one.name}: {one.type}" for one in fields(value) if not one.name.startswith("_"))
        for member in sorted(_members(value)):
            found = inspect.getattr_static(value, member)
            if ".".join([*name.split("."), member][-2:]) not in PRIVATE:
                yield from _member(f"{name}.{member}", found)
    elif inspect.isroutine(value):
        yield name + _parameters(value)
    else:
        yield f"{name} = {value!r}" if isinstance(value, str) else name


def _members(kind: type) -> set[str]:
    """Return the names of the public members that are defined in robochoc."""
    ours = [base for base in kind.__mro__ if base.__module__.startswith("robochoc")]
    names = {name for base in ours for name in vars(base) if not name.startswith("_")}
    return names - ({one.name for one in fields(kind)} if is_dataclass(kind) else set())


def _member(name: str, found: object) -> Iterator[str]:
    if isinstance(found, classmethod | staticmethod):
        yield name + _parameters(found.__func__)
    elif inspect.isfunction(found):
        yield name + _parameters(found)
    else:
        yield name


def _parameters(value: object) -> str:
    """Return the names of the parameters, in order; `=` marks those with a default."""
    if not callable(value):
        return ""
    words: list[str] = []
    for one in inspect.signature(value).parameters.values():
        prefix = "*" if one.kind is one.VAR_POSITIONAL else "**" if one.kind is one.VAR_KEYWORD else ""
        if one.kind is one.KEYWORD_ONLY and not any(word.startswith("*") for word in words):
            words.append("*")
        words.append(f"{prefix}{one.name}{'' if one.default is one.empty else '='}")
    return f"({', '.join(words)})"


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    sys.stdout.writelines(f"{line}\n" for line in public_api())
