"""Marks on the functions of robochoc that are called, in all processes of a test, in a file that they share.

A copy of the tree whose root has `sitecustomize.py` (`prepare`) is compiled with a store at the start of each function.
"""

from __future__ import annotations

import ast
import builtins
import json
import mmap
import os
import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType

NAME = "__reached__"
FOLDER = ".reached"
"""Where a tree has the marks, and the compiled files with stores."""
Function = ast.FunctionDef | ast.AsyncFunctionDef


def functions(node: ast.AST, scope: str = "") -> Iterator[tuple[str, Function]]:
    """Yield the functions below `node` with their qualified names, in the order of their places."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, Function | ast.ClassDef):
            name = f"{scope}.{child.name}".lstrip(".")
            if not isinstance(child, ast.ClassDef):
                yield name, child
            yield from functions(child, name)
        else:
            yield from functions(child, scope)


def with_stores(source: bytes | str, first: int) -> ast.Module:
    """Parse `source`; add to each function a store that marks it, numbered from `first`."""
    tree = ast.parse(source)
    for number, (_, function) in enumerate(functions(tree), first):
        (store,) = ast.parse(f"{NAME}[{number}] = 1").body
        for part in ast.walk(store):
            if isinstance(part, ast.expr | ast.stmt):
                ast.copy_location(part, function.body[0])
        function.body.insert(int(ast.get_docstring(function, clean=False) is not None), store)
    return tree


def prepare(tree: Path) -> list[tuple[str, str]]:
    """Make a tree mark its functions; return them, path and name, by their numbers."""
    found: list[tuple[str, str]] = []
    starts = {}
    for path in sorted(str(file.relative_to(tree)) for file in tree.glob("robochoc/**/*.py")):
        starts[path] = len(found)
        found += ((path, name) for name, _ in functions(ast.parse((tree / path).read_bytes())))
    (tree / FOLDER).mkdir()
    (tree / FOLDER / "starts.json").write_text(json.dumps({"size": len(found), "starts": starts}))
    program = f"from tests.mutation.marks import install\n\ninstall({str(tree)!r})\n"
    (tree / "sitecustomize.py").write_text(program)
    return found


def install(root: str) -> None:
    """Compile the modules of robochoc below `root` with stores, from now on in this process."""
    table = json.loads(Path(root, FOLDER, "starts.json").read_bytes())
    starts, as_it_was = table["starts"], SourceFileLoader.source_to_code

    def source_to_code(self: SourceFileLoader, data: bytes, path: str, **options: int) -> CodeType:
        name = os.path.relpath(os.fsdecode(path), root)
        content = with_stores(data, starts[name]) if name in starts else data
        return as_it_was(self, content, path, **options)

    SourceFileLoader.source_to_code = source_to_code  # type: ignore[assignment,method-assign]
    sys.pycache_prefix = str(Path(root, FOLDER, "compiled"))
    share(root)


def share(root: str) -> mmap.mmap:
    """Map the file of marks of this process and of those that it starts: a worker of pytest-xdist has its own."""
    size = json.loads(Path(root, FOLDER, "starts.json").read_bytes())["size"]
    file = os.open(Path(root, FOLDER, os.environ.get("PYTEST_XDIST_WORKER", "main")), os.O_RDWR | os.O_CREAT)
    os.ftruncate(file, size)
    marks = mmap.mmap(file, size)
    os.close(file)
    setattr(builtins, NAME, marks)
    return marks
