"""Notebooks of the documentation: their cells are run one after the other, and give what stands below them."""

from __future__ import annotations

import ast
import io
import json
from contextlib import redirect_stdout
from typing import Any

from tests.support.program import ROOT
from tests.support.snippets import agrees

NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))


def run(source: str, names: dict[str, object]) -> tuple[str, object]:
    """Run a cell. Return what it prints, and the value of its last line, as notebooks show it."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(tree, "<cell>", "exec"), names)  # noqa: S102 - our own pages
        value = None
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "<cell>", "eval"), names)  # noqa: S307 - the same
    return printed.getvalue(), value


def test_the_cells_of_a_notebook_give_what_stands_below_them() -> None:
    for notebook in NOTEBOOKS:
        names: dict[str, object] = {"__name__": "__main__"}
        cells: list[dict[str, Any]] = json.loads(notebook.read_text())["cells"]
        code = [cell for cell in cells if cell["cell_type"] == "code"]
        assert len(code) > 2
        for cell in code:
            printed, value = run("".join(cell["source"]), names)
            said = {output["output_type"]: output for output in cell["outputs"]}
            stream = "".join(said["stream"]["text"]) if "stream" in said else ""
            assert agrees(stream, printed), cell["source"]
            shown = "".join(said["execute_result"]["data"]["text/plain"]) if "execute_result" in said else "None"
            assert agrees(shown, repr(value)), cell["source"]
            if hasattr(value, "_repr_html_"):
                assert value._repr_html_()
