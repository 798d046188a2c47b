"""A check for `if __name__ == "__main__":`. Processes that are not forked import (execute) the program's file."""

from __future__ import annotations

import ast
import sys
from pathlib import Path
from types import FrameType

from robochoc.solver.errors import UnsupportedError


def require_main_guard() -> None:
    """Raise `UnsupportedError` if importing the program's file would execute its current line, too.

    The line is allowed below `if __name__ == "__main__":`, if processes do not import the file (it does not exist, or
    it is the `__main__` of a package: see `multiprocessing.spawn`), or if its source cannot be read.
    """
    main = sys.modules["__main__"]
    file = getattr(main, "__file__", None)
    if file is None or getattr(getattr(main, "__spec__", None), "name", "").rpartition(".")[2] == "__main__":
        return
    line = _line_of(vars(main), file)
    if line is not None and not _is_guarded(Path(file), line):
        raise UnsupportedError(
            f"{file}:{line}: each robot's process imports this file, and would run this line again: move the code that"
            ' starts the robots below if __name__ == "__main__":, or use runtime="processes"'
        )


def _line_of(names: dict[str, object], file: str) -> int | None:
    """Return the line being executed in the module with these `names`, or None if another thread executes it."""
    frame: FrameType | None = sys._getframe(1)  # noqa: SLF001 - `inspect.stack` reads the files of all frames
    while frame is not None:
        code = frame.f_code
        if frame.f_globals is names and code.co_name == "<module>" and code.co_filename == file:
            return frame.f_lineno
        frame = frame.f_back
    return None


def _is_guarded(file: Path, line: int) -> bool:
    """Return whether `line` is executed only in the program itself, according to the syntax tree."""
    try:
        before = [one for one in ast.parse(file.read_bytes()).body if one.lineno <= line]
    except (OSError, SyntaxError, ValueError, RecursionError):
        return True
    guards = [one for one in before if isinstance(one, ast.If) and "__name__" in _names(one.test)]
    return any(one is before[-1] or _ends_the_program(one) for one in guards)


def _ends_the_program(guard: ast.If) -> bool:
    return any(isinstance(one, ast.Raise) for one in ast.walk(guard)) or bool({"exit", "_exit"} & _names(guard))


def _names(tree: ast.AST) -> set[str]:
    parts = list(ast.walk(tree))
    return {one.id for one in parts if isinstance(one, ast.Name)} | {
        one.attr for one in parts if isinstance(one, ast.Attribute)
    }
