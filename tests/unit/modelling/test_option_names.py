"""Messages to users of the library name arguments, not options of the command line, and no files of the repository."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import robochoc
from robochoc.communication.simulator.channel import read_channel
from robochoc.formats.diagnostics import invalid_input
from robochoc.modelling.option_names import errors_in_python, in_python
from robochoc.modelling.solving import ARGUMENTS
from tests.support.cases import looped

PACKAGE = Path(robochoc.__file__).parent
LIBRARY = (
    *("communication", "formats", "generators", "journal", "model", "modelling", "protocols", "run", "solver"),
    *("system", "verification", "api.py"),
)
"""The parts of the package whose messages reach users of the library. The others are of the command line."""
TABLES = {"system/pydcop_words.py"}
"""Tables whose options and commands are shown by the command line alone."""
TRANSLATED = ARGUMENTS | {"format", "infinity", "owner", "allow_code", "hosts", "identity"}
"""The arguments of `solve`, `load`, and `AgentsContainer`."""
OF_COMMANDS = {
    *("--private", "--sniffable", "--may", "--role"),  # of `robochoc master` and `robochoc authority`
    *("--situation", "--long", "--help", "--scale"),  # of other commands, or of all
    *("--intension", "--distribution"),  # of export, and of pyDCOP
    "--force",  # `Model.save` has its own message
    "--force-reinstall",  # of pip
    *("--warm", "--enable-native-access"),  # of programs that robochoc starts
}
"""Options in messages that have no argument in Python."""
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
REPOSITORY = re.compile(r"docs/\w+/|\.md\b")


@looped(
    ("text", "expected"),
    [
        ("add --runtime simulator --schedule cycles", "add runtime='simulator', schedule='cycles'"),
        ("--deadline and --timeout", "deadline and timeout"),
        ("(--ncccs 100, --deadline 0.5)", "(ncccs=100, deadline=0.5)"),
        ("after --deadline SECONDS: add it", "after deadline=SECONDS: add it"),
        ("these do: sfb (--protocol)", "these do: sfb (protocol)"),
        ("--set cycles=N and --set anytime=yes", "settings={'cycles': N} and settings={'anytime': 'yes'}"),
        ("--message-loss or --on-loss fail", "message_loss or on_loss='fail'"),
        ("--spare and --with ortools.", "spares and central_with='ortools'."),
        ("use --name NAME", "use --name NAME"),
        ("well-known -- x--timeout", "well-known -- x--timeout"),
        ("'robochoc solve --runtime simulator' does", "'robochoc solve --runtime simulator' does"),
        ("use --allow-code if you trust it", "use allow_code=True if you trust it"),
    ],
)
def test_options_become_arguments(text: str, expected: str) -> None:
    assert in_python(text, ARGUMENTS | {"allow_code"}) == expected


def texts(part: str, pattern: re.Pattern[str]) -> Iterator[tuple[str, str]]:
    """Yield the file, and the text, of each string with `pattern` in a part of the package, without docstrings."""
    path = PACKAGE / part
    for file in [path] if path.is_file() else sorted(path.rglob("*.py")):
        source = file.read_text(encoding="utf-8")
        if not pattern.search(source):
            continue
        tree = ast.parse(source)
        alone = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            text = node.value if isinstance(node, ast.Constant) and id(node) not in alone else None
            if isinstance(text, str) and pattern.search(text):
                yield str(file.relative_to(PACKAGE)), text


def test_every_option_in_a_message_of_the_library_has_an_argument() -> None:
    found = [(file, text) for part in LIBRARY for file, text in texts(part, OPTION)]
    left = {(file, one) for file, text in found for one in OPTION.findall(in_python(text, TRANSLATED))}
    assert len(found) > 60
    assert {(file, one) for file, one in left if one not in OF_COMMANDS and file not in TABLES} == set()


def test_messages_name_no_file_of_the_repository() -> None:
    parts = [one.name for one in PACKAGE.iterdir() if one.name not in {"app", "cli", "__pycache__"}]
    named = [(file, text) for part in parts for file, text in texts(part, REPOSITORY)]
    assert named == []


def pair() -> tuple[robochoc.Model, Any]:
    """Return a model of two robots, and the variable of the first one."""
    model = robochoc.Model("pair")
    x, y = (model.robot(f"r{place}").variable("x", range(3)) for place in range(2))
    model.add(x != y)
    return model, x


def solve_with(**options: Any) -> Callable[[Path], object]:  # noqa: ANN401 - of `solve`
    """Return a call of `solve` with these options."""
    return lambda _: pair()[0].solve(**options)


def read_text(name: str, content: str, **options: Any) -> Callable[[Path], object]:  # noqa: ANN401 - of `load`
    """Return a call of `load` for a file with this content."""

    def read(folder: Path) -> object:
        (folder / name).write_text(content)
        return robochoc.load(folder / name, **options)

    return read


XCSP3 = (
    '<instance format="XCSP3" type="CSP"><variables><var id="x"> 0 1 </var><var id="y"> 0 1 </var></variables>'
    "<constraints><intension> ne(x,y) </intension></constraints></instance>"
)
PYDCOP = """name: t
objective: min
domains: {d: {values: [0, 1]}}
variables: {x: {domain: d}, y: {domain: d}}
constraints: {c: {type: intention, source: code.py, function: source.f(x, y)}}
agents: [a, b]
"""
RING = robochoc.ArrayProblem(2, 2, [(0, 1)], [[1, 0], [0, 1]])
REFUSED: dict[str, Callable[[Path], object]] = {
    "unknown protocol": solve_with(protocol="nope"),
    "unknown option": solve_with(timeuot=3),
    "cycles": solve_with(cycles=3),
    "both limits": solve_with(timeout=1, deadline=1),
    "improve": solve_with(improve=3),
    "seed": solve_with(seed=2**70),
    "negative limit": solve_with(timeout=-1),
    "limit": solve_with(messages=-1),
    "runtime": solve_with(runtime="nope"),
    "order": solve_with(order=["r0", "r9"]),
    "setting": solve_with(protocol="dsa", settings={"probabilty": 1}),
    "value of a setting": solve_with(protocol="dsa", settings={"cycles": "many"}),
    "settings": solve_with(settings=["cycles"]),
    "count": solve_with(protocol="abt", count=True),
    "count with OR-Tools": solve_with(protocol="central", count=True, central_with="ortools"),
    "central": solve_with(protocol="central", messages=3),
    "solver": solve_with(central_with="ortools"),
    "filters": solve_with(filters=["rot13"]),
    "spares": solve_with(spares=2),
    "arrays": solve_with(protocol="abt", runtime="arrays"),
    "cluster": solve_with(protocol="mgm2", runtime="arrays", cluster="tcp://x:1"),
    "loss": solve_with(message_loss=2.0),
    "message loss": solve_with(protocol="dsa", message_loss=0.1, runtime="arrays"),
    "incomplete": solve_with(protocol="dsa", withdraw="minimum"),
    "withdraw": solve_with(withdraw="nonsense"),
    "delay": solve_with(delay=5, schedule="random"),
    "patience": solve_with(patience=2),
    "preprocess": solve_with(preprocess="ac", runtime="arrays", protocol="dsa"),
    "missing folder": lambda folder: robochoc.load(folder / "none"),
    "missing file": lambda folder: robochoc.load(folder / "none.xml"),
    "missing team": lambda folder: robochoc.Model.load(folder / "none"),
    "empty file": read_text("r.xml", ""),
    "unknown format": read_text("r.txt", "hello"),
    "name of a format": read_text("r.txt", "hello", format="nope"),
    "owner": read_text("p.xml", XCSP3, owner="("),
    "owner that does not match": read_text("p.xml", XCSP3, owner="z"),
    "code": read_text("t.yaml", PYDCOP),
    "team as a model": lambda folder: robochoc.Model.load(write(folder / "p.xml", XCSP3)),
    "existing folder": pair()[0].save,
    "folder with other files": lambda folder: pair()[0].save(write(folder / "other.txt", "").parent, replace=True),
    "file in place of a folder": lambda folder: pair()[0].save(write(folder / "other.txt", ""), replace=True),
    "channel": lambda folder: read_channel(write(folder / "c.toml", "x = 1")),
    "array problem": lambda _: RING.solve("dsa", cycle=3),
    "array problem, protocol": lambda _: RING.solve("abt"),
    "array problem, cluster": lambda _: RING.solve("mgm2", cluster="tcp://x:1"),
    "array problem, anytime": lambda _: RING.solve("dsa", anytime="yes"),
    "array problem, splits": lambda _: RING.solve("maxsum", split=0.5),
    "container": lambda _: robochoc.AgentsContainer().set_agent_type("MasterNope"),
    "model": lambda _: pair()[0].add(pair()[1] != 1),
    "result": lambda _: robochoc.read_result(b"{"),
    "journal": lambda folder: robochoc.journal.rows(write(folder / "j", "nope")),
    "conflict": lambda _: pair()[0].conflict(timeout=-1),
}
"""Calls that are refused, with a folder for files."""


def write(path: Path, content: str) -> Path:
    """Write a file, and return its path."""
    path.write_text(content)
    return path


@looped("name", list(REFUSED))
def test_refusals_name_arguments_and_no_files_of_the_repository(name: str, tmp_path_factory: Any) -> None:  # noqa: ANN401 - pytest's
    with pytest.raises((robochoc.RobochocError, ValueError, TypeError)) as refusal:
        REFUSED[name](tmp_path_factory.mktemp("files"))
    text = re.sub(r"'robochoc [^']*'", "", str(refusal.value))  # commands for the shell
    assert OPTION.findall(text) == []
    assert REPOSITORY.findall(text) == []


def test_diagnostics_are_translated_with_their_text() -> None:
    with pytest.raises(robochoc.InvalidInputError) as refusal, errors_in_python({"owner"}):
        raise invalid_input("--owner.xml", "--owner 'x' is wrong", "change --owner")
    (diagnostic,) = refusal.value.diagnostics
    assert str(refusal.value) == str(diagnostic) == "--owner.xml: owner 'x' is wrong (change owner)"


def test_errors_and_reasons_name_arguments() -> None:
    model = robochoc.Model()
    slots = [model.robot(f"r{i}").variable("x", range(4)) for i in range(4)]
    model.add(robochoc.all_different(slots))
    with pytest.raises(robochoc.UnsupportedError, match="runtime='simulator', schedule='cycles'"):
        model.solve(cycles=3)
    outcome = model.solve("abt", messages=1)
    assert (outcome.verdict, outcome.reason) == ("unknown", "the limit of messages was reached (messages=1)")
    assert "--" not in str(outcome.to_dict())
