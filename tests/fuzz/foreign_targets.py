"""Files of other tools that robochoc reads: each dialect, and the names that an import leaves beside a team."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from random import Random

from robochoc.cli.reports.notes import note_lines
from robochoc.formats import InvalidInputError, check_team, read_team, write_team
from robochoc.formats.dialects.dialect import Dialect, ExportOptions, ImportOptions, ImportResult
from robochoc.formats.dialects.registry import find_dialect, read_foreign, recognise
from robochoc.formats.names_file import NAMES_FILE, names_json, original_names
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError
from tests.fuzz.file_targets import folder
from tests.fuzz.harness import Target, assert_clear
from tests.fuzz.mutations import (
    LARGEST,
    Mutation,
    files_of,
    folder_of,
    in_folder,
    one_of,
    spoilt_bytes,
    spoilt_json,
    spoilt_text,
    spoilt_xml,
)
from tests.support.foreign_files import CFN, FRODO, WCSP, XDISCSPS
from tests.support.foreign_problems import random_problem
from tests.support.task_lists import LIST

OPTIONS = (
    ImportOptions(),
    ImportOptions(infinity=100),
    ImportOptions(owner="([a-z]+)"),
)
"""What an import may be asked."""
MANY = 3000
"""Teams with more constraints are not written again: what takes long because it is long is no finding."""


def _first_file(files: dict[str, bytes]) -> bytes:
    return next(iter(files.values()))


def _written(dialect: Dialect, team: Team) -> dict[str, bytes]:
    return dict(dialect.write(team, ExportOptions()).files) if dialect.write else {}


@cache
def exported(name: str, *shown: str) -> Sequence[bytes]:
    """Files in the dialect called `name`: those that are `shown`, and what some random problems make."""
    dialect = find_dialect(name)
    assert dialect is not None, f"there is no dialect {name}"
    chance = Random(3)
    made = [text.encode() for text in shown]
    for number in range(12 if dialect.write else 0):
        with suppress(UnsupportedError):
            made.append(_first_file(_written(dialect, random_problem(chance, plain=number % 2 == 0)[1])))
    return [text for text in made if text and len(text) < LARGEST]


def check_file(name: str, file_name: str, content: bytes, options: Sequence[ImportOptions] = OPTIONS) -> bool:
    """A file is recognised or not, read or refused; of what is read, a team is made that can be read."""
    with folder() as place:
        path = place / file_name
        path.write_bytes(content)
        recognise(path)
        return _checked(partial(read_foreign, [path], options[len(content) % len(options)], name)) is not None


def check_tasks(content: bytes) -> bool:
    """A list of robots and tasks is read or refused. It has no options."""
    return check_file("tasks", "p.yaml", content, OPTIONS[:1])


def check_several(content: bytes) -> bool:
    """The files of several agents are one problem, or refused."""
    with folder() as place:
        paths = []
        for number, text in enumerate(files_of(content).values()):
            paths.append(place / f"{number}.xml")
            paths[-1].write_bytes(text)
        return _checked(lambda: read_foreign(paths, OPTIONS[0], "frodo")) is not None


def _checked(read: Callable[[], ImportResult]) -> Team | None:
    """Return the team that is read, which others can read from its files; None where it is refused."""
    try:
        imported = read()
        check_team(imported.team)
    except InvalidInputError as invalid:
        assert_clear(str(invalid))
        return None
    for line in note_lines(imported.notes, "'--report' lists them"):
        assert_clear(line)
    if sum(1 for _ in imported.team.constraints()) > MANY:
        return imported.team
    with folder() as place:
        again = place / "team"
        write_team(replace(imported.team, scenario=()), again)
        (again / NAMES_FILE).write_bytes(names_json(imported.dialect, imported.names))
        assert _outline(read_team(again)) == _outline(imported.team), "another team is read from what was written"
        assert original_names(again) == imported.names, "other names are read from what was written"
    return imported.team


def _outline(team: Team) -> dict[str, object]:
    """The robots with the values and scopes that they have; their order may have become another valid one."""
    return {
        robot.name: (
            {one.name: [one.domain.label(value) for value in one.domain] for one in robot.variables},
            sorted((one.name, one.scope) for one in (*robot.private, *robot.shared)),
        )
        for robot in team.robots
    }


# Names


def names_files() -> Sequence[bytes]:
    """Files of original names."""
    return [names_json("frodo", names) for names in ({}, {"a_1": "a 1", "v": "é#\n"})]


def check_names(content: bytes) -> bool:
    """Original names are read, or refused."""
    with folder() as place:
        (place / NAMES_FILE).write_bytes(content)
        try:
            original_names(place)
        except InvalidInputError as invalid:
            assert_clear(str(invalid))
            return False
        return True


# What the exports do not show

PLAIN = """<instance><presentation name="?" format="XCSP 2.0"/><domains><domain name="D">0 2..3 1</domain></domains>
<variables nbVariables="3"><variable name="V0" domain="D"/><variable name="V1" domain="D"/>
<variable name="V2" domain="D"/>
</variables><constraints><constraint name="C" scope="V0 V1 V2" reference="global:allDifferent">
<parameters>[ V0 V1 V2 3 ]</parameters></constraint></constraints></instance>"""

_SELF = """<instance><presentation name="p{me}" format="XCSP 2.1_FRODO"/><agents self="{me}"><agent name="a"/>
<agent name="b"/></agents><domains><domain name="d">1..2</domain></domains><variables>
<variable name="xa" domain="d" agent="a"/><variable name="xb" domain="d" agent="b"/></variables>
<relations><relation name="r" arity="2" semantics="soft" defaultCost="1">0: 1 2</relation></relations>
<constraints><constraint name="c" arity="2" scope="xa xb" reference="r"/></constraints></instance>"""
SEVERAL = {f"{me}.xml": _SELF.format(me=me).encode() for me in ("a", "b")}

PYDCOP = """name: small
objective: min
domains:
  colours: {values: [R, G]}
  few: {values: [0..2]}
  odd: {values: [0.5, yes]}
variables:
  x: {domain: few}
  y: {domain: few, initial_value: 1}
  c: {domain: colours, cost_function: -0.25 if c == 'G' else 0.5, noise_level: 0.2}
  o: {domain: odd}
external_variables:
  e: {domain: few, initial_value: 1}
agents: {a1: {capacity: 10}, a2: {}}
constraints:
  k1:
    type: intention
    function: abs(x - y) + 2 * (x + y) - 3 + e
  k2:
    type: intention
    function: |
      t = 0
      for i in range(x):
        t += i - 1
      return t if len({x, y}) == 2 else min(sum([v for v in [x, y] if v > 0]), 3)
  k3:
    type: extensional
    variables: [x, y]
    default: 10
    values:
      1.5: 0 1 | 1 2
      -2: 2 2
distribution_hints:
  must_host: {a1: [x], a2: [y]}
"""

XCSP3 = """<instance format="XCSP3" type="COP"><variables>
<array id="x" size="[4]"> 0..3 </array><array id="m" size="[2][2]"> <domain for="m[0][]"> 1..2 </domain>
<domain for="others"> 0 2..3 </domain></array><var id="s"> 0 1 </var><var id="t" as="s"/></variables><constraints>
<intension> or(eq(x[0],x[1]),gt(add(x[2],mul(2,x[3])),sub(s,t))) </intension>
<group><intension> ne(%0,%1) </intension><args> x[0] x[1] </args><args> x[1] x[2] </args></group>
<slide><list> x[] </list><intension> le(dist(%0,%1),3) </intension></slide>
<block><allDifferent> m[][0] s </allDifferent></block>
<extension><list> x[0] x[1] </list><supports> (0,1)(1,2)(*,3)(2,*) </supports></extension>
<sum><list> x[] </list><coeffs> 1 -2 3 1 </coeffs><condition> (le,7) </condition></sum>
<count><list> x[] </list><values> 1 2 </values><condition> (in,0..3) </condition></count>
<nValues><list> x[] </list><condition> (ge,1) </condition></nValues>
<cardinality><list> x[] </list><values> 0 1 </values><occurs> 0..3 0..3 </occurs></cardinality>
<element><list> m[0][] </list><index> s </index><value> m[0][1] </value></element>
<minimum><list> x[] </list><condition> (le,2) </condition></minimum>
<maximum><list> x[] </list><condition> (ge,s) </condition></maximum>
<ordered><list> s x[3] </list><operator> le </operator></ordered>
<lex><list> x[0..1] </list><list> x[2..3] </list><operator> le </operator></lex>
<noOverlap><origins> x[0] x[1] </origins><lengths> 1 1 </lengths></noOverlap>
<cumulative><origins> x[0..1] </origins><lengths> 1 2 </lengths><heights> 1 1 </heights>
<condition> (le,2) </condition></cumulative>
<precedence><list> x[] </list><values> 1 2 </values></precedence>
<knapsack><list> s t </list><weights> 1 2 </weights><profits> 2 1 </profits><condition> (le,3) </condition>
<condition> (ge,0) </condition></knapsack>
<binPacking><list> s t </list><sizes> 1 1 </sizes><condition> (le,2) </condition></binPacking>
<regular><list> s t </list><transitions> (a,0,a)(a,1,b)(b,0,b)(b,1,b) </transitions><start> a </start>
<final> a b </final></regular>
<mdd><list> s t </list><transitions> (r,0,n)(r,1,n)(n,0,f)(n,1,f) </transitions></mdd>
<instantiation><list> t </list><values> 1 </values></instantiation>
<channel><list> m[1][0] s </list></channel>
<circuit> x[] </circuit><clause> s not(t) </clause></constraints>
<objectives><minimize type="sum"><list> x[] </list><coeffs> 1 2 3 4 </coeffs></minimize></objectives></instance>"""
XCSP3_SYMBOLS = """<instance format="XCSP3" type="CSP"><variables><var id="c" type="symbolic"> red green </var>
<var id="d" type="symbolic"> red blue </var></variables><constraints><intension> ne(c,d) </intension>
<extension><list> c d </list><conflicts> (red,blue) </conflicts></extension></constraints></instance>"""

TOURS = """{distance: straight, places: 2, tours: yes, model: several, robots: {ann: {at: [0, 0], most: 3, speed: 2},
bob: {at: [9, 9.5], skills: [eye], capacity: 4}}, tasks: {near: {at: [4, 0], worth: 5}, far: {at: [6, 0], worth: 5.25,
deadline: 7}, big: {at: [1, 1], needs: [eye], worth: 8, load: 2}}, synergies: [{tasks: [near, far], worth: -1}]}"""

_of_xml = one_of(spoilt_xml, spoilt_xml, spoilt_xml, spoilt_text, spoilt_bytes)
_of_text = one_of(spoilt_text, spoilt_text, spoilt_text, spoilt_bytes)


def _target(name: str, file_name: str, mutation: Mutation, *shown: str) -> Target:
    return Target(f"foreign-{name}", partial(exported, name, *shown), mutation, partial(check_file, name, file_name))


TARGETS = (
    _target("frodo", "p.xml", _of_xml, FRODO, PLAIN),
    Target("foreign-frodo-agents", lambda: [folder_of(SEVERAL)], in_folder(_of_xml), check_several),
    _target("xdiscsp", "p.xml", _of_xml, *XDISCSPS),
    _target("xcsp3", "p.xml", _of_xml, XCSP3, XCSP3_SYMBOLS),
    _target("pydcop", "p.yaml", _of_text, PYDCOP),
    _target("cfn", "p.cfn", _of_text, CFN, '[["up" >-5.0] [2 2] [[[0] [1.0 0.5]] [[0 1] [-1.0 0.5 -2.0 5.5]]]]'),
    _target("wcsp", "p.wcsp", _of_text, WCSP),
    Target("foreign-tasks", partial(exported, "tasks", LIST, TOURS), _of_text, check_tasks),
    Target("foreign-names", names_files, one_of(spoilt_json, spoilt_json, spoilt_text, spoilt_bytes), check_names),
)
