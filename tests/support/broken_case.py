"""How a case of `broken.py` is made: a team without a fault, what is done to it, and what must be said then."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

ROBOT_1 = """\
<?xml version="1.0" encoding="UTF-8"?>
<instance>
  <presentation type="DisCSP"/>
  <domains nbDomains="1">
    <domain name="D1" nbValues="4">1..4</domain>
  </domains>
  <variables nbVariables="2">
    <variable name="V1" domain="D1"/>
    <variable name="W1" domain="D1"/>
  </variables>
  <constraints nbConstraints="1">
    <constraint name="C0" reference="lt" scope="V1 W1"/>
  </constraints>
  <agents_neighbours>
    <agents_parent/>
    <agents_children>
      <agent name="Robot2" variable="V1">
        <constraints nbConstraints="1">
          <constraint model="PKC" name="C3" reference="ne" scope="V1 V2"/>
        </constraints>
      </agent>
      <agent name="Robot3" variable="V1 W1"/>
    </agents_children>
  </agents_neighbours>
</instance>
"""

ROBOT_2 = """\
<?xml version="1.0" encoding="UTF-8"?>
<instance>
  <presentation type="DisCSP"/>
  <domains nbDomains="1">
    <domain name="D1" nbValues="6">1..4 7 9</domain>
  </domains>
  <variables nbVariables="1">
    <variable name="V2" domain="D1"/>
  </variables>
  <relations nbRelations="1">
    <relation name="r1" arity="2" nbTuples="3" semantics="conflicts">1 1|2 2|3 3</relation>
  </relations>
  <predicates nbPredicates="1">
    <predicate name="p1">
      <parameters>int X int Y int i int j</parameters>
      <expression>
        <functional>and(ne(X,Y),ne(abs(sub(X,Y)),abs(sub(i,j))))</functional>
      </expression>
    </predicate>
  </predicates>
  <agents_neighbours>
    <agents_parent>
      <agent name="Robot1">
        <constraints nbConstraints="3">
          <constraint model="TKC" name="C1" reference="p1" scope="V1 V2 1 2">
            <parameters>V1 V2 1 2</parameters>
          </constraint>
          <constraint model="TKC" name="C2" reference="r1" scope="V1 V2"/>
          <constraint model="PKC" name="C3" reference="le" scope="V1 V2"/>
        </constraints>
      </agent>
    </agents_parent>
    <agents_children>
      <agent name="Robot3" variable="V2"/>
    </agents_children>
  </agents_neighbours>
</instance>
"""

ROBOT_3 = """\
<?xml version="1.0" encoding="UTF-8"?>
<instance>
  <presentation type="DisCSP"/>
  <domains nbDomains="1">
    <domain name="D1" nbValues="4">1..4</domain>
  </domains>
  <variables nbVariables="1">
    <variable name="V3" domain="D1"/>
  </variables>
  <topics nbTopics="1">
    <topic name="/drone3/waypoint3" x="mul(2,V3)" y="-1" z="V3"/>
  </topics>
  <predicates nbPredicates="1">
    <predicate name="sum">
      <parameters>int A int B int C</parameters>
      <expression>
        <functional>ge(add(A,B,C),4)</functional>
      </expression>
    </predicate>
  </predicates>
  <agents_neighbours>
    <agents_parent>
      <agent name="Robot1">
        <constraints nbConstraints="1">
          <constraint model="TKC" name="C4" reference="ne" scope="V1 V3"/>
        </constraints>
      </agent>
      <agent name="Robot2">
        <constraints nbConstraints="1">
          <constraint model="TKC" name="C5" reference="sum" scope="W1 V2 V3"/>
        </constraints>
      </agent>
    </agents_parent>
    <agents_children/>
  </agents_neighbours>
</instance>
"""

TEAM = {"Robot1.xml": ROBOT_1, "Robot2.xml": ROBOT_2, "Robot3.xml": ROBOT_3}
"""Three robots, nothing wrong: a complex one, both models, an n-ary constraint, both kinds of definition."""


@dataclass(frozen=True)
class Expected:
    """A diagnostic: its file, a text on its line (none: no line), and what the message and the hint contain."""

    file: str
    on: str
    fragments: tuple[str, ...]

    def place(self, folder: Path) -> str:
        """`FILE:LINE` as it must be printed."""
        path = folder / self.file if self.file else folder
        if not self.on:
            return f"{path}"
        before, found, _ = path.read_text().partition(self.on)
        assert found, f"{self.on!r} is not in {path}"
        return f"{path}:{before.count(chr(10)) + 1}"


@dataclass(frozen=True)
class Broken:
    """A case. `write` makes the team in a folder; `target` is what is then read, below that folder."""

    name: str
    write: Callable[[Path], object]
    diagnostics: tuple[Expected, ...]
    target: str = ""

    def __str__(self) -> str:
        return self.name

    def expected(self, folder: Path) -> list[tuple[str, tuple[str, ...]]]:
        """For each diagnostic, in any order: how it begins, and what else is in it."""
        return [(f"{one.place(folder)}: ", one.fragments) for one in self.diagnostics]


def write_files(folder: Path, files: Mapping[str, str | bytes]) -> None:
    """A folder with `files`, which may lie in folders of their own."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def case(name: str, edits: list[tuple[str, str, str]], *expected: tuple[str, str, str | tuple[str, ...]]) -> Broken:
    """The team with some texts replaced: (file, old, new) each."""

    def write(folder: Path) -> None:
        files = dict(TEAM)
        for file, old, new in edits:
            assert old in files[file], f"{old!r} is not in {file}"
            files[file] = files[file].replace(old, new)
        write_files(folder, files)

    return Broken(name, write, diagnostics(expected))


def weighted(name: str, edits: list[tuple[str, str, str]], *expected: tuple[str, str, str | tuple[str, ...]]) -> Broken:
    """The team as a DisWCSP, with some texts replaced."""
    return case(name, [*((file, '"DisCSP"', '"DisWCSP"') for file in TEAM), *edits], *expected)


def files(
    name: str, changes: Mapping[str, str | bytes | None], *expected: tuple[str, str, str | tuple[str, ...]]
) -> Broken:
    """The team with some files added, replaced or taken away."""
    content = {file: text for file, text in {**TEAM, **changes}.items() if text is not None}
    return Broken(name, lambda folder: write_files(folder, content), diagnostics(expected))


def other(
    name: str,
    write: Callable[[Path], object],
    *expected: tuple[str, str, str | tuple[str, ...]],
    target: str = "",
) -> Broken:
    """The team, and something else done to its folder."""

    def both(folder: Path) -> None:
        write_files(folder, TEAM)
        write(folder)

    return Broken(name, both, diagnostics(expected), target)


def diagnostics(expected: tuple[tuple[str, str, str | tuple[str, ...]], ...]) -> tuple[Expected, ...]:
    return tuple(Expected(file, on, (text,) if isinstance(text, str) else text) for file, on, text in expected)


R1, R2, R3 = TEAM
"""The names of the files, and some lines of them that cases replace."""
C4 = '<constraint model="TKC" name="C4" reference="ne" scope="V1 V3"/>'
C5 = '<constraint model="TKC" name="C5" reference="sum" scope="W1 V2 V3"/>'
D2 = '<domain name="D1" nbValues="6">1..4 7 9</domain>'
D4 = '<domain name="D1" nbValues="4">1..4</domain>'
TOLD = '<agent name="Robot3" variable="V1 W1"/>'
SCENARIO = "scenario.xml"
P1 = "and(ne(X,Y),ne(abs(sub(X,Y)),abs(sub(i,j))))"
RELATION = '<relation name="r1" arity="2" nbTuples="3" semantics="conflicts">1 1|2 2|3 3</relation>'


def domain(text: str) -> tuple[str, str, str]:
    """Robot2 with another domain."""
    return (R2, D2, f'<domain name="D1">{text}</domain>')


def predicate(text: str) -> tuple[str, str, str]:
    """Robot2 with another predicate."""
    return (R2, P1, text)


def relation(text: str) -> tuple[str, str, str]:
    """Robot2 with another relation."""
    return (R2, RELATION, text)


def scenario(*changes: str) -> str:
    """A scenario of one event."""
    return "\n".join(['<scenario>\n<event after="solved">', *changes, "</event></scenario>\n"])
