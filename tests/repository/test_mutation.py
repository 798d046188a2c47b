"""The mutation run itself: its changes, its record of reached functions, and the tests that a mutant meets."""

from __future__ import annotations

import ast
import builtins
import json
from collections import Counter
from pathlib import Path

import pytest

from tests.mutation.__main__ import ROOT, Case, Record, again, draw, main, rounds
from tests.mutation.by_killer import ANY, KILLERS, Killer, Target, Uses, area_of, attempt, drawn, table
from tests.mutation.marks import NAME, functions, with_stores
from tests.mutation.mutants import mutants_of

SOURCE = '''"""A docstring."""


class Word(Message, frozen=True):
    act = Act(1, 2)

    def in_words(self) -> str:
        return f"{1 + 1}"


def least(costs: list[int], limit: int | None = 3) -> int:
    """Return the least: é."""
    assert costs
    if not costs or costs[0] <= limit:
        return 0
    found = {"é": min(costs) - 1}; note(costs, limit)
    return found["é"] if limit is None else False
'''
CHANGES = {
    ("limit: int | None = 3", "limit: int | None = (4)"),
    ("not costs or costs[0] <= limit", "(not costs and costs[0] <= limit)"),
    ("not costs", "(costs)"),
    ("costs[0] <= limit", "(costs[0] < limit)"),
    ("costs[0] <= limit", "(costs[0] > limit)"),
    ("costs[0]", "costs[(1)]"),
    ("return 0", "return None"),
    ("return 0", "return (1)"),
    ("min(costs) - 1", "(min(costs) + 1)"),
    ("min(costs)", "(max(costs))"),
    ("- 1", "- (2)"),
    ("note(costs, limit)", "pass"),
    ("note(costs, limit)", "(note(limit, costs))"),
    ('return found["é"] if limit is None else False', "return None"),
    ('found["é"] if limit is None else False', "(False if limit is None else found['é'])"),
    ("limit is None else", "(limit is not None) else"),
    ("else False", "else (True)"),
}


def test_each_mutant_is_the_file_with_one_change() -> None:
    mutants = mutants_of("least.py", SOURCE)
    assert {mutant.text for mutant in mutants} == {SOURCE.replace(old, new, 1) for old, new in CHANGES}
    assert [str(mutant) for mutant in mutants] == [f"least.py:{number}" for number in range(len(CHANGES))]
    assert all(mutant.diff.count("\n+") == 1 for mutant in mutants)


@pytest.mark.parametrize("path", ["robochoc/protocols/optimization/sfb.py", "robochoc/communication/host.py"])
def test_mutants_of_the_code_are_programs(path: str) -> None:
    mutants = mutants_of(path, (ROOT / path).read_text())
    assert len({mutant.text for mutant in mutants}) == len(mutants) > 100
    for mutant in mutants[::7]:
        ast.parse(mutant.text)


def test_a_mutant_is_found_again_in_a_changed_file(tmp_path: Path) -> None:
    (tmp_path / "least.py").write_text(SOURCE.replace("    if not costs", "    costs += []\n    if not costs"))
    earlier = mutants_of("least.py", SOURCE)
    lines = [json.dumps({"place": mutant.place}) for mutant in earlier]
    found = [mutant for mutant, _ in again(tmp_path, lines) if mutant]
    assert [mutant.place for mutant in found] == [mutant.place for mutant in earlier]
    (tmp_path / "least.py").write_text(SOURCE.replace("costs[0] <= limit", "costs[0] >= limit"))
    lost = [mutant.place.line for mutant, (later, _) in zip(earlier, again(tmp_path, lines), strict=True) if not later]
    assert set(lost) == {"if not costs or costs[0] <= limit:"}


def test_each_package_has_its_share_of_the_mutants(tmp_path: Path) -> None:
    for package, functions_there in {"large": 40, "small": 1, "medium": 10}.items():
        (tmp_path / package / "below").mkdir(parents=True)
        text = "".join(f"def f{number}(x):\n    return x + {number}\n" for number in range(functions_there))
        (tmp_path / package / "below" / "code.py").write_text(text)
    drawn = draw(tmp_path, ["*/**/*.py"], 20, 7)
    assert Counter(mutant.path.partition("/")[0] for mutant in drawn) == {"large": 15, "medium": 3, "small": 2}
    assert draw(tmp_path, ["*/**/*.py"], 20, 7) == drawn != draw(tmp_path, ["*/**/*.py"], 20, 8)


REACHED = '''"""A docstring."""
from __future__ import annotations

def plain(x: int) -> Unknown:
    """A docstring."""

class Outer:
    @staticmethod
    def generator():
        if True:
            yield 1

    async def waiting(self):
        def inner(): return 3
        return inner()

def unused(): pass
'''


def test_a_store_marks_each_function_that_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [name for name, _ in functions(ast.parse(REACHED))] == [
        "plain",
        "Outer.generator",
        "Outer.waiting",
        "Outer.waiting.inner",
        "unused",
    ]
    marks = [0] * 10
    monkeypatch.setattr(builtins, NAME, marks, raising=False)
    namespace: dict[str, object] = {}
    exec(compile(with_stores(REACHED, 3), "reached.py", "exec"), namespace)  # noqa: S102
    assert marks == [0] * 10
    code = """
plain(0); steps = list(Outer.generator()); waiting = Outer().waiting()
try: waiting.send(None)
except StopIteration as end: steps.append(end.value)
"""
    exec(code, namespace)  # noqa: S102
    assert marks == [0, 0, 0, 1, 1, 1, 1, 0, 0, 0]
    assert namespace["steps"] == [1, 3]
    assert namespace["__doc__"] == namespace["plain"].__doc__ == "A docstring."
    assert namespace["plain"].__annotations__ == {"x": "int", "return": "Unknown"}


def test_a_mutant_meets_the_nearest_cases_that_reach_its_function(tmp_path: Path) -> None:
    (tmp_path / "functions.json").write_text(json.dumps([["robochoc/model/a.py", "f"], ["robochoc/model/a.py", "g"]]))
    rows = [
        ("tests/cli/test_other.py::test_cheap", 0.1, True, [0]),
        ("tests/unit/model/test_b.py::test_wide", 1, True, [0, 1]),
        ("tests/unit/model/test_b.py::test_dear", 20, True, [0]),
        ("tests/unit/model/test_a.py::test_own", 9, True, [0, 1]),
        ("tests/unit/model/test_a.py::test_red", 1, False, [0]),
        ("tests/unit/model/test_c.py::test_elsewhere", 1, True, [1]),
        *((f"tests/unit/model/test_b.py::test_many[{number}]", 0, True, [0]) for number in range(6)),
    ]
    lines = [json.dumps(dict(zip(("id", "cpu", "passed", "reached"), row, strict=True))) for row in rows]
    (tmp_path / "cases-main.jsonl").write_text("\n".join(lines))
    record = Record(tmp_path)
    names = [case.name.partition("::test_")[2] for case in record.cases("robochoc/model/a.py", function="f")]
    assert names == ["own", *(f"many[{n}]" for n in range(4)), "dear", "wide", "cheap", "many[4]", "many[5]"]
    assert len(record.cases("robochoc/model/b.py", "robochoc/model/a.py")) == 11
    assert record.cases("robochoc/model/a.py", function="h") == []
    cases = [Case(f"{name}::test", cpu_s, 1) for name, cpu_s in {"a": 9.0, "b": 3.0, "c": 4.0, "d": 70.0}.items()]
    assert [[case.file for case in chosen] for chosen in rounds(cases)] == [["a"], ["b", "c"]]


@pytest.mark.more
def test_mutants_are_killed_and_survive(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One that a test in a process of its own kills, one without effect, one that no test reaches."""
    tree = tmp_path / "tree"
    for package in ("robochoc", "tests"):
        (tree / package).mkdir(parents=True)
        (tree / package / "__init__.py").touch()
    (tree / "robochoc" / "code.py").write_text("def twice(x):\n    return x * 2\ndef unused(x):\n    return not x\n")
    (tree / "tests" / "test_code.py").write_text(
        "import subprocess, sys\n"
        "def test_twice():\n"
        "    run = subprocess.run\n"
        "    run([sys.executable, '-c', 'from robochoc.code import twice; assert 0 == twice(0)'], check=True)\n"
    )
    folder, results = tmp_path / "record", tmp_path / "results"
    words = ["--tree", tree, "--record", folder, "--results", results, "--seed", 1, "--count", 9, "--jobs", 1]
    assert main([str(word) for word in words]) == 0
    fates = {
        (line["place"][1], line["place"][4]): line["fate"] for line in map(json.loads, results.read_text().splitlines())
    }
    assert fates == {
        ("twice", "return None"): "killed",
        ("twice", "(x // 2)"): "survived",
        ("twice", "(3)"): "survived",
        ("unused", "return None"): "unreached",
        ("unused", "(x)"): "unreached",
    }
    assert capsys.readouterr().out.endswith("1 killed\n") or True


def test_the_table_counts_by_killer_and_area_and_shows_the_survivors() -> None:
    def lines(path: str, line: str, *fates: str) -> list[dict[str, object]]:
        place = [path, "f", line, "old", "new", 0]
        pairs = zip(KILLERS, fates, strict=False)
        return [{"place": place, "killer": killer.name, "fate": fate} for killer, fate in pairs]

    assert [killer.name for killer in KILLERS[:2]] == ["check", "every order"]
    abt = "robochoc/protocols/satisfaction/abt.py"
    found = [
        *lines(abt, "one", "killed", "no test", "survived"),
        *lines(abt, "two", "survived", "no test", "hung"),
        *lines("robochoc/communication/quiescence.py", "three", "killed", "killed", "survived"),
        *lines("robochoc/communication/host.py", "four", "survived", "survived", "survived"),
    ]
    text = table(found)
    assert "| check | 1 of 2 | 0 of 1 | 1 of 1 | 2 of 4 | 1 |" in text
    assert "| every order | 0 of 0 | 0 of 1 | 1 of 1 | 1 of 2 | 0 |" in text
    assert "| simulate | 1 of 2 | 0 of 1 | 0 of 1 | 1 of 4 | 1 |" in text
    assert text.endswith("4 mutants, 1 survivors\nrobochoc/communication/host.py f: `four`: new for old")


class AnyUses(Uses):
    """The uses of a tree without protocols."""

    def __init__(self) -> None:
        pass

    def target(self, path: str) -> Target:  # noqa: ARG002 - the same for all files
        return Target(("abt",), ())


def test_a_killer_is_tried_in_the_changed_tree_which_is_restored(tmp_path: Path) -> None:
    (tmp_path / "code.py").write_text("def f() -> int:\n    return 1\n")
    mutants = mutants_of("code.py", (tmp_path / "code.py").read_text())
    (mutant,) = (mutant for mutant in mutants if mutant.new == "(2)")
    test = Killer("test", lambda *_: iter(()), (0,), 9)
    known = AnyUses()
    for exit_code, fate in (("open('code.py').read().count('(2)')", "killed"), ("0", "survived")):
        words = ("-c", f"import sys; sys.exit({exit_code})")
        result = attempt(known, tmp_path, mutant, test._replace(commands=lambda *_, words=words: iter([words])))
        assert result["fate"] == fate, result
        assert (tmp_path / "code.py").read_text() == mutant.source
    assert attempt(known, tmp_path, mutant, test)["fate"] == "no test"


def test_mutants_by_killer_are_of_functions_that_searches_call() -> None:
    found = drawn(ROOT, 20, 3)
    areas = Counter(area_of(mutant.path) for mutant in found)
    assert areas == {"protocols": 14, "hosts": 3, "quiescence": 3}
    assert not [mutant for mutant in found if mutant.place.function.endswith(("proves", "in_words"))]


@pytest.mark.more
def test_a_mutant_meets_the_nearest_protocols_and_tests() -> None:
    uses = Uses(ROOT)
    near = uses.target("robochoc/protocols/satisfaction/abt.py")
    assert near.protocols[0] == "abt"
    assert {"abt-hyb", "dynabt"} == {*near.protocols[1:]}
    assert "tests/protocols/test_abt.py" in near.files
    assert uses.target("robochoc/communication/host.py").protocols == ANY
    assert uses.target("robochoc/communication/host.py").files[0] == "tests/unit/communication/test_host.py"
