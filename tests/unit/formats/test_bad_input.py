"""Whatever is wrong with an input: the one message that says so, at the right place, and quickly."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from robochoc.formats import InvalidInputError, find_teams, read_robot, read_team
from robochoc.model.problem import Robot, Team
from tests.support.broken import CASES
from tests.support.broken_case import TEAM, Broken, write_files
from tests.support.cases import looped
from tests.support.examples import examples

FUZZ = examples(80, slow=3000, also_suppress=(HealthCheck.function_scoped_fixture,))


def read_all(path: Path) -> list[Team]:
    return [read_team(team) for team in find_teams(path)]


@looped("case", CASES)
def test_broken_input(case: Broken, tmp_path: Path) -> None:
    case.write(tmp_path)
    expected = case.expected(tmp_path)
    with pytest.raises(InvalidInputError) as caught:
        read_all(tmp_path / case.target)
    told = str(caught.value).splitlines()
    assert len(told) == len(expected), caught.value
    for beginning, fragments in expected:
        fitting = [
            line
            for line in told
            if line.startswith(beginning.removesuffix(": ")) and all(fragment in line for fragment in fragments)
        ]
        assert len(fitting) == 1, f"{beginning}{fragments}\n{caught.value}"
        assert fitting[0].startswith(beginning) or fragments[0].startswith(":")
        assert len(fitting[0]) < 600
        assert fitting[0].endswith(")")


def test_what_the_schema_refuses_does_not_hide_other_mistakes(tmp_path: Path) -> None:
    edits = [
        ('reference="ne"', 'reference="nee"'),  # another layer's mistake
        ('x="mul(2,V3)"', 'w="mul(2,V3)"'),
        ('<constraint model="TKC" name="C5"', '<constraint model="TKC"'),  # its name is required: it is left out
    ]
    text = TEAM["Robot3.xml"]
    for before, after in edits:
        assert before in text
        text = text.replace(before, after)
    write_files(tmp_path, {**TEAM, "Robot3.xml": text})
    with pytest.raises(InvalidInputError) as caught:
        read_team(tmp_path)
    assert [one.message for one in caught.value.diagnostics] == [
        "<topic> has no attribute 'w'",
        "unknown reference 'nee'",
        "<constraint> lacks its attribute 'name'",
    ]


def test_no_mistake_follows_from_what_the_schema_refuses(tmp_path: Path) -> None:
    text = TEAM["Robot3.xml"].replace('<variable name="V3" domain="D1"/>', '<variable name="V3"/>')
    write_files(tmp_path, {**TEAM, "Robot3.xml": text})
    with pytest.raises(InvalidInputError) as caught:
        read_team(tmp_path)
    assert [one.message for one in caught.value.diagnostics] == ["<variable> lacks its attribute 'domain'"]


def test_every_case_has_a_name_of_its_own() -> None:
    assert len({case.name for case in CASES}) == len(CASES) >= 45


def test_the_team_of_the_cases_is_not_broken(tmp_path: Path) -> None:
    write_files(tmp_path, TEAM)
    assert isinstance(read_team(tmp_path), Team)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_unreadable_files_and_folders(tmp_path: Path) -> None:
    write_files(tmp_path, TEAM)
    (tmp_path / "Robot1.xml").chmod(0)
    with pytest.raises(InvalidInputError, match="Permission denied"):
        read_team(tmp_path)
    (tmp_path / "locked").mkdir(mode=0)
    with pytest.raises(InvalidInputError, match="Permission denied"):
        find_teams(tmp_path / "locked")


def test_mistakes_come_in_the_order_of_files_and_lines(tmp_path: Path) -> None:
    for name in ("Robot10", "Robot9"):
        write_files(tmp_path, {f"{name}.xml": TEAM["Robot2.xml"].replace("1..4", "4..1").replace("|2 2|", "|2|")})
    with pytest.raises(InvalidInputError) as caught:
        read_team(tmp_path)
    places = [(Path(one.file).name, one.line) for one in caught.value.diagnostics]
    assert places == [("Robot9.xml", 5), ("Robot9.xml", 11), ("Robot10.xml", 5), ("Robot10.xml", 11)]


def test_ten_thousand_mistakes_are_not_all_told(tmp_path: Path) -> None:
    row = '<constraint name="C" reference="unknown" scope="V1 V1"/>'
    content = (
        TEAM["Robot1.xml"]
        .replace('nbConstraints="1"', "")
        .replace("</constraints>\n  <agents_n", row * 10_000 + "</constraints><agents_n")
    )
    write_files(tmp_path, {"Robot1.xml": content})
    with pytest.raises(InvalidInputError) as caught:
        read_robot(tmp_path / "Robot1.xml")
    assert len(caught.value.diagnostics) == 101
    assert "more mistakes" in str(caught.value.diagnostics[-1])


def test_many_mistakes_against_the_schema_do_not_take_hours(tmp_path: Path) -> None:
    content = '<instance><presentation type="DisCSP"/><domains>' + "<domain/>\n" * 10**5 + "</domains></instance>"
    write_files(tmp_path, {"Robot1.xml": content})
    with pytest.raises(InvalidInputError) as caught:
        read_robot(tmp_path / "Robot1.xml")
    assert [one.line for one in caught.value.diagnostics] == list(range(1, 102))


def test_a_copy_over_more_tuples_than_can_be_counted(tmp_path: Path) -> None:
    names = [f"V{number}" for number in range(1000)]
    variables = "".join(f'<variable name="{name}" domain="D1"/>' for name in names)
    parameters = "int Y" + "".join(f" int X{number}" for number in range(1000))
    files = {}
    for name, own, text, agents in [
        ("A", variables, "ne(X1,X2)", '<agents_children><agent name="B">{}</agent></agents_children>'),
        (
            "B",
            '<variable name="W" domain="D1"/>',
            "gt(X1,X2)",
            '<agents_parent><agent name="A">{}</agent></agents_parent>',
        ),
    ]:
        shared = (
            f'<constraints><constraint name="C" model="TKC" reference="p" scope="W {" ".join(names)}"/></constraints>'
        )
        files[f"{name}.xml"] = f"""<instance><presentation type="DisCSP"/>
            <domains><domain name="D1">1..100000</domain></domains><variables>{own}</variables>
            <predicates><predicate name="p"><parameters>{parameters}</parameters>
            <expression><functional>{text}</functional></expression></predicate></predicates>
            <agents_neighbours>{agents.format(shared)}</agents_neighbours></instance>"""
    write_files(tmp_path, files)
    with pytest.raises(InvalidInputError, match="leave the copy out"):
        read_team(tmp_path)


# --- fuzzing: a robot, a team or InvalidInput, and nothing else ---------------------------------------------------

SOURCES = {name: content.encode() for name, content in TEAM.items()}
PIECES = st.one_of(
    st.binary(max_size=8),
    st.sampled_from(
        [b"<", b">", b'"', b"&", b"-", b"9" * 30, b"V1", b"V2", b" ", b"|", b"..", b"TKC", b"PKC", b"(", b",", b"/"]
    ),
)
ATTRIBUTES = [
    (name, content[start:end])
    for name, content in SOURCES.items()
    for start, end in [
        (position + 2, content.index(b'"', position + 2))
        for position in range(len(content) - 1)
        if content[position : position + 2] == b'="'
    ]
]
WORDS = ["0", "-1", "V1", "V2", "V3", "W1", "TKC", "PKC", "soft", "DisWCSP", "r1", "Robot2", "x()", "eq"]
VALUES = st.one_of(
    st.text(max_size=12).map(lambda text: text.replace("<", "").replace("&", "").replace('"', "")),
    st.sampled_from(["", "9" * 400, "V1 V2 V3", *WORDS]),
)


def read_it(folder: Path) -> None:
    for read in (lambda: read_robot(folder / "Robot2.xml"), lambda: read_team(folder)):
        try:
            found: Robot | Team | InvalidInputError = read()
        except InvalidInputError as invalid:
            found = invalid
        assert isinstance(found, Robot | Team) or len(str(found).splitlines()) == len(found.diagnostics) > 0


@FUZZ
@given(st.sampled_from(sorted(SOURCES)), st.lists(st.tuples(st.floats(0, 1), st.integers(0, 20), PIECES), max_size=4))
def test_mutated_bytes(tmp_path: Path, name: str, changes: list[tuple[float, int, bytes]]) -> None:
    content = SOURCES[name]
    for where, length, piece in changes:
        position = int(where * len(content))
        content = content[:position] + piece + content[position + length :]
    write_files(tmp_path, {**TEAM, name: content})
    read_it(tmp_path)


@FUZZ
@given(st.lists(st.tuples(st.sampled_from(ATTRIBUTES), VALUES), min_size=1, max_size=3))
def test_mutated_attributes(tmp_path: Path, changes: list[tuple[tuple[str, bytes], str]]) -> None:
    content = dict(SOURCES)
    for (name, old), new in changes:
        content[name] = content[name].replace(b'"' + old + b'"', b'"' + new.encode(errors="replace") + b'"', 1)
    write_files(tmp_path, content)
    read_it(tmp_path)


@FUZZ
@given(st.binary(max_size=200))
def test_any_bytes(tmp_path: Path, content: bytes) -> None:
    write_files(tmp_path, {"Robot2.xml": content})
    read_it(tmp_path)
