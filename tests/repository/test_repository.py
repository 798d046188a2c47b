"""Rules that hold for the whole repository."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Collection, Iterator

from tests.support.program import ROOT

SOURCES = sorted((ROOT / "robochoc").rglob("*.py"))
SHARED = ("support", "fuzz", "mutation", "simulation")
"""Packages of `tests` that others import."""


def test_no_test_imports_another() -> None:
    """What tests share is in `tests.support`. Programs within strings count as well."""
    packages = "|".join(
        path.parent.name for path in (ROOT / "tests").glob("*/__init__.py") if path.parent.name not in SHARED
    )
    imported = re.compile(rf"^\s*(from|import) tests\.({packages})\b", re.MULTILINE)
    found = [path for path in (ROOT / "tests").rglob("*.py") if imported.search(path.read_text())]
    assert found == []


def test_limits_for_what_hangs_are_set_in_one_place() -> None:
    """`tests/support/limits.py`. A `timeout` of few seconds is over in some test; one of many is such a limit."""
    limit = re.compile(r"\btimeout=[0-9_]{2}")
    found = [path for path in (ROOT / "tests").rglob("*.py") if limit.search(path.read_text())]
    assert found == []


def test_readers_of_foreign_xml_work_on_views() -> None:
    """`formats/element_view.py` reports what a reader has not read, so no reader of a dialect may parse XML itself.

    `xcsp3/writer.py` parses only the document that the solver's process returns.
    """
    parsing = re.compile(r"formats\.xml\b|\b(fromstring|iterparse|XMLParser|XMLPullParser|ElementTree|minidom|sax)\b")
    dialects = ROOT / "robochoc" / "formats" / "dialects"
    found = {str(path.relative_to(dialects)) for path in dialects.rglob("*.py") if parsing.search(path.read_text())}
    assert found == {"xcsp3/writer.py"}


def test_untrusted_bytes_reach_neither_eval_nor_pickle() -> None:
    """`control.py` pickles the messages of a parent to a process that it has started, as `multiprocessing` does.

    `lazy_dataclass.py` compiles methods from the names of our own fields, as `dataclasses` does.
    """
    trusted = {"control.py", "lazy_dataclass.py"}
    used = re.compile(r"(?<![\w.])(eval|exec)\(|\bpickle\b|Pickler")
    assert not [path for path in SOURCES if path.name not in trusted and used.search(path.read_text())]


def test_names_that_say_nothing_are_not_used() -> None:
    assert not [path for path in SOURCES if re.search(r"manager|utils|helper", path.stem)]


def test_members_of_text_enums_are_compared_by_value() -> None:
    """`==`, `in`, `match` and dictionaries treat the text "minimum" as `Withdrawal.MINIMUM`; `is` would not.

    Texts are converted where they enter (`Options`, decoders); a text that slips through still means the same here.
    """
    sources = {path: path.read_text() for path in SOURCES}
    enums = {name for text in sources.values() for name in re.findall(r"^class (\w+)\(.*StrEnum", text, re.MULTILINE)}
    assert {"Verdict", "Runtime", "Withdrawal"} <= enums
    likely = re.compile(rf"\bis\s+(not\s+)?(\w+\.)*({'|'.join(enums)})\.[A-Z]|({'|'.join(enums)})\.[A-Z]\w*\s+is\b")
    found = {path: _identities(ast.parse(text), enums) for path, text in sources.items() if likely.search(text)}
    assert {f"{path.relative_to(ROOT)}:{line}" for path, lines in found.items() for line in lines} == set()


def test_comparisons_by_identity_are_found() -> None:
    code = (
        "a is Withdrawal.MINIMUM; 1 < 2 is not run.Withdrawal.MAXIMAL; a == Withdrawal.MINIMUM; a is Other.X; a is None"
    )
    assert list(_identities(ast.parse(code), {"Withdrawal"})) == [1, 1]


def _identities(tree: ast.AST, enums: Collection[str]) -> Iterator[int]:
    """Yield the lines in which something `is`, or `is not`, a member of one of the enums."""
    member = re.compile(rf"(\w+\.)*({'|'.join(enums)})\.[A-Z]\w*")
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            for operator, *sides in zip(node.ops, [node.left, *node.comparators], node.comparators, strict=False):
                compared = isinstance(operator, ast.Is | ast.IsNot)
                if compared and any(member.fullmatch(ast.unparse(side)) for side in sides):
                    yield node.lineno


def test_every_dependency_is_explained() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    design = (ROOT / "docs" / "explanation" / "design" / "dependencies.md").read_text()
    for requirement in project["dependencies"]:
        name = re.split(r"[<>=!~ ]", requirement)[0]
        assert f"| {name} |" in design, name
