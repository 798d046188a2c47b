"""Import all that an extra of robochoc is for, in an environment that has this extra alone.

These are the modules of its requirements that robochoc imports anywhere, and the modules of robochoc that import them.
An extra that lacks a requirement fails. `make release` runs this file in new environments; only robochoc is imported.
"""

from __future__ import annotations

import argparse
import ast
import importlib
import re
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import robochoc

NETWORK = "robochoc.communication.network"
"""It needs all of the extra `network`; ROS over zenoh needs zenoh alone."""


def normalised(name: str) -> str:
    """Return the name of a distribution as indexes write it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def requirements_of(extra: str) -> set[str]:
    """Return the names of the distributions that an extra requires; those of extras that it includes as well."""
    found = set()
    for line in requires("robochoc") or ():
        requirement, _, marker = line.partition(";")
        if re.search(rf"extra == ['\"]{normalised(extra)}['\"]", marker):
            name, included = re.match(r"([\w.-]+)(?:\[(.*?)\])?", requirement).groups()  # type: ignore[union-attr]
            if name == "robochoc":
                found |= {one for other in included.split(",") for one in requirements_of(other.strip())}
            else:
                found.add(normalised(name))
    return found


def imports_of(source: str) -> Iterator[str]:
    """Yield the modules that a source imports, also those within functions and by name."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "importlib.import_module":
            yield from (str(name.value) for name in node.args if isinstance(name, ast.Constant))


def modules_for(packages: set[str]) -> tuple[set[str], set[str]]:
    """Return the modules of these packages that robochoc imports, and the modules of robochoc that import them."""
    root = Path(robochoc.__file__).parent
    theirs: set[str] = set()
    ours: set[str] = set()
    for path in root.rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        if any(package in source for package in packages):
            used = {name for name in imports_of(source) if name.partition(".")[0] in packages}
            if used:
                theirs |= used
                ours.add(".".join(path.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__"))
    return theirs, ours


def main() -> None:
    """Read the name of the extra, import, and print how many modules there are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("extra")
    requirements = requirements_of(parser.parse_args().extra)
    provided = packages_distributions()
    packages = {name for name, by in provided.items() if requirements & {normalised(one) for one in by}}
    theirs, ours = modules_for(packages)
    if "cryptography" not in packages:
        ours = {name for name in ours if not name.startswith(NETWORK)}
    if not theirs:
        sys.exit("robochoc imports nothing of this extra")
    for name in sorted(theirs) + sorted(ours):
        importlib.import_module(name)
    print(f"{len(theirs)} modules of it and {len(ours)} of robochoc imported")  # noqa: T201 - for make


if __name__ == "__main__":
    main()
