"""Robots that do not belong together, scenarios, and many mistakes at once."""

from __future__ import annotations

from tests.support.broken_case import (
    C4,
    C5,
    D4,
    R1,
    R2,
    R3,
    ROBOT_1,
    SCENARIO,
    TOLD,
    case,
    domain,
    files,
    other,
    predicate,
    scenario,
)


def told(*copies: str) -> tuple[str, str, str]:
    """Robot1 repeats constraints with Robot3, as the original platform's files do."""
    return (R1, TOLD, "\n".join(['<agent name="Robot3"><constraints>', *copies, "</constraints></agent>"]))


def ring(name: str, parent: str, child: str) -> str:
    """A robot between a parent and a child."""
    return f"""\
<instance><presentation type="DisCSP"/><domains><domain name="D1">1..2</domain></domains>
<variables><variable name="V{name}" domain="D1"/></variables>
<agents_neighbours>
<agents_children><agent name="{child}" variable="V{name}"/></agents_children>
<agents_parent>
<agent name="{parent}"/>
</agents_parent></agents_neighbours></instance>
"""


NEIGHBOURS = [
    files("a neighbour without a file", {R3: None}, (R1, TOLD, ("Robot3.xml", "has no file")),
          (R2, '<agent name="Robot3"', "the child 'Robot3' has no file")),
    case("a misspelt neighbour", [(R3, 'name="Robot2"', 'name="Robot_2"')],
         (R3, '"Robot_2"', ("'Robot_2' has no file", "did you mean 'Robot2'")),
         (R2, '<agent name="Robot3"', "does not list 'Robot2' as its parent")),
    case("a child that is not listed back", [(R2, '<agent name="Robot3" variable="V2"/>', "")],
         (R3, '<agent name="Robot2"', ("does not list 'Robot3' as its child", "Robot2.xml:3"))),
    case("each the other's parent",
         [(R1, TOLD, ""), (R1, "<agents_parent/>", '<agents_parent><agent name="Robot3"/></agents_parent>')],
         (R1, '"Robot3"', ("'Robot3' is listed as parent", "Robot3.xml:23"))),
    case("itself as neighbour",
         [(R3, "<agents_children/>", '<agents_children>\n<agent name="Robot3"/></agents_children>')],
         (R3, '<agent name="Robot3"', "is the robot itself")),
    case("a neighbour twice",
         [(R3, "<agents_children/>", '<agents_children>\n<agent name="Robot1"/></agents_children>')],
         (R3, '<agent name="Robot1"/>', "listed as parent already")),
    files("a cycle of parents",
          {"A.xml": ring("A", "C", "B"), "B.xml": ring("B", "A", "C"), "C.xml": ring("C", "B", "A")},
          ("C.xml", '<agent name="B"', ("cycle: B -> C -> A -> B", "A.xml:6", "B.xml:6"))),
    case("a DisWCSP among DisCSPs", [(R2, '"DisCSP"', '"DisWCSP"')],
         (R2, "<presentation", ("the robot is a DisWCSP", "Robot1.xml:3"))),
    case("two owners of one variable", [(R3, "V3", "V2"), (R3, "W1 V2 V2", "W1 V1 V2")],
         (R3, "<variable ", ("'V2' belongs to 'Robot2' too", "Robot2.xml:8"))),
    case("a variable that its owner does not have", [(R3, 'scope="V1 V3"', 'scope="V9 V3"')],
         (R3, 'name="C4"', ("no robot has the variable 'V9'", "Robot1.xml:3"))),
    case("a constraint under the wrong parent", [(R3, C4, ""), (R3, C5, C4 + C5), (R3, 'nbConstraints="1"', "")],
         (R3, 'name="C4"', ("no variable of the parent 'Robot2'", "move it to 'Robot1'"))),
    case("n-ary under the higher parent", [(R3, C5, ""), (R3, C4, C4 + "\n" + C5), (R3, ' nbConstraints="1"', "")],
         (R3, 'name="C5"', ("the lowest parent of its scope is 'Robot2'", "Robot2.xml:3"))),
    case("n-ary in a higher file", [(R2, '"le" scope="V1 V2"', '"le" scope="V3 V2"')],
         (R2, 'name="C3"', ("'V3' belongs to 'Robot3', which is not a parent", "Robot3.xml:8"))),
    case("a PKC of three robots", [(R3, 'model="TKC" name="C5"', 'model="PKC" name="C5"')],
         (R3, 'name="C5"', ("PKC constraint over more than two", "Robot2.xml:3"))),
    case("a part over a third robot", [(R1, '"ne" scope="V1 V2"', '"ne" scope="V1 V3"')],
         (R1, 'name="C3"', ("'V3' is not a variable of 'Robot1' or 'Robot2'", "Robot2.xml:3"))),
    case(
        "a part over what its owner shows to nobody",
        [
            (R2, 'nbVariables="1"', ""),
            (R2, '<variable name="V2"', '<variable name="W2" domain="D1"/>\n    <variable name="V2"'),
            (R1, '"ne" scope="V1 V2"', '"ne" scope="V1 W2"'),
        ],
        (R1, 'name="C3"', ("contains 'W2', which 'Robot2' shows to no robot", "add the part", "Robot2.xml:8")),
    ),
    case("a child told what is not one's own", [(R2, 'variable="V2"', 'variable="V1"')],
         (R2, 'variable="V1"', ("must know 'V1'", "known variables of this robot: V2"))),
    case("a child told twice", [(R2, 'variable="V2"', 'variable="V2 V2"')],
         (R2, 'variable="V2 V2"', "list 'V2' twice")),
    case("a child told too little", [(R1, 'variable="V1 W1"', 'variable="V1"')],
         (R1, 'name="Robot3"', ("must also know W1", "Robot3.xml:30"))),
    case("a copy that the child does not have", [told(C4, C5.replace("sum", "lt").replace("W1 V2 V3", "W1 V3"))],
         (R1, 'name="C5"', ("the copy of 'C5'", "'Robot3' has no such constraint"))),
    case("a copy that says something else", [told(C4.replace("ne", "lt"))],
         (R1, 'name="C4"', ("'2 1' is forbidden here, and allowed in the", "Robot3.xml:25"))),
    case(
        "a copy too large to compare",
        [
            told(C4.replace("ne", "gt")),
            (R1, D4, '<domain name="D1">1..2000</domain>'),
            (R3, D4, '<domain name="D1">1..2000</domain>'),
        ],
        (R1, 'name="C4"', ("more than 1000000", "leave the copy out")),
    ),
]  # fmt: skip

SCENARIOS = [
    files("a scenario that is a robot", {SCENARIO: ROBOT_1}, (SCENARIO, "<instance>", "expected <scenario>")),
    files("a truncated scenario", {SCENARIO: "<scenario>\n"}, (SCENARIO, "", ":2: is not well-formed XML")),
    files("an event without a time", {SCENARIO: "<scenario><event/></scenario>"},
          (SCENARIO, "<event", "lacks its attribute 'after'")),
    files("an event at no time", {SCENARIO: '<scenario><event after="noon"/></scenario>'},
          (SCENARIO, "<event", ('after="noon"', "200 messages"))),
    files("an unknown change", {SCENARIO: '<scenario><event after="solved">\n<explode/></event></scenario>'},
          (SCENARIO, "<explode/>", "<explode> does not belong in <event>")),
    files("a value of 5000 digits", {SCENARIO: scenario(f'<add_value variable="V1" value="{"9" * 5000}"/>')},
          (SCENARIO, "<add_value", "at most 18 digits")),
    files("a robot from outside", {SCENARIO: scenario('<add_agent file="../../x.xml"/>')},
          (SCENARIO, "<add_agent", "outside the team's folder")),
    files("a robot from anywhere", {SCENARIO: scenario('<add_agent file="/etc/passwd"/>')},
          (SCENARIO, "<add_agent", "outside the team's folder")),
    files("a robot from nowhere", {SCENARIO: scenario('<add_agent file="late/X.xml"/>')},
          (SCENARIO, "<add_agent", "there is no file 'late/X.xml'")),
    other("a scenario that is a folder", lambda folder: (folder / SCENARIO).mkdir(),
          (SCENARIO, "", "not a regular file")),
]  # fmt: skip

MANY = [
    case(
        "a lot of mistakes at once",
        [
            domain("4..1"),
            predicate("nee(X,Y)"),
            (R2, "|2 2|", "|2|"),
            (R2, 'domain="D1"', 'domain="D2"'),
            (R2, '"le"', '"lee"'),
            (R2, 'variable="V2"', 'variable="V9"'),
            (R1, '"DisCSP"', '"CSP"'),
            (R1, "<agents_parent/>", "<agents_parents/>"),
            (R3, "</topics>", "</topic>"),
        ],
        (R1, "<presentation", 'type="CSP"'),
        (R1, "<agents_parents/>", "<agents_parents> does not belong"),
        (R2, "<domain ", "4..1 is empty"),
        (R2, "<relation ", "'2' has 1 values"),
        (R2, "<functional", "operator 'nee'"),
        (R2, "<variable ", "unknown domain 'D2'"),
        (R2, 'name="C3"', "unknown reference 'lee'"),
        (R2, '<agent name="Robot3"', "must know 'V9'"),
        (R3, "</topic>", "not well-formed XML"),
    ),
    case("two broken files, and two that disagree",
         [(R2, "</instance>", ""), (R3, 'scope="V1 V3"', 'scope="V1,V3"'), (R1, 'scope="V1 W1"', 'scope="V1"')],
         (R1, 'name="C0"', "lt requires 2 terms"), (R2, "", ":38: is not well-formed"), (R3, 'name="C4"', "'V1,V3'")),
]  # fmt: skip
