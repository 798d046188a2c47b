"""Texts that users see name pages by their titles: a wheel has no folder `docs`."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from collections.abc import Iterator

from tests.support.cases import cases
from tests.support.program import ROOT
from tests.support.public_api import STABLE

PACKAGE = ROOT / "robochoc"
SHOWN = (PACKAGE / "cli" / "commands", PACKAGE / "protocols")
"""Packages whose docstrings are shown: by `--help`, and by `robochoc protocols NAME`."""
NAMED = re.compile(r"documentation, page |(?<=\bpage )(?=[A-Z][\w ]* of the documentation)")


def texts() -> Iterator[tuple[str, str]]:
    """Yield the strings that users may see, each with its place."""
    for path in sorted(PACKAGE.rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        if "docs/" not in source and "documentation" not in source:
            continue
        tree = ast.parse(source)
        statements = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                is_docstring = id(node) in statements
                if not is_docstring or any(path.is_relative_to(folder) for folder in SHOWN):
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value
    for name in STABLE:
        module = importlib.import_module(name)
        for public in module.__all__:
            value = getattr(module, public)
            yield f"{name}.{public}", inspect.getdoc(value) or ""
            for member, found in inspect.getmembers(value) if inspect.isclass(value) else ():
                yield f"{name}.{public}.{member}", inspect.getdoc(found) or ""


def titles() -> list[str]:
    """Return the titles of all pages, without markup."""
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")]
    return [found[1].replace("`", "") for page in pages if (found := re.search(r"^# (.+)$", page, re.MULTILINE))]


def test_texts_name_pages_by_the_titles_they_have() -> None:
    known = re.compile("|".join(rf"{re.escape(title)}(?!\w)" for title in titles()))
    found = 0
    with cases() as each:
        for place, text in texts():
            if "docs/" not in text and "documentation" not in text:
                continue
            with each(place):
                assert not re.search(r"\bdocs/", text), "a wheel has no docs/: write the title, (documentation, page X)"
                one_line = " ".join(text.split())
                for named in NAMED.finditer(one_line):
                    found += 1
                    assert known.match(one_line, named.end()), f"no page has this title: {one_line[named.end() :][:50]}"
    assert found >= 20
