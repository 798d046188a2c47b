"""Changes that a team cannot take: each is told once, with the line of the scenario or of the added robot's file."""

from __future__ import annotations

from tests.support.broken_case import R1, SCENARIO, TEAM, Broken, files, scenario

LATE = "late/Robot9.xml"
ROBOT_9 = """\
<instance>
  <presentation type="DisCSP"/>
  <domains><domain name="D1">1..4</domain></domains>
  <variables><variable name="V9" domain="D1"/></variables>
  <relations><relation name="far" semantics="supports">1 3|3 1</relation></relations>
  <agents_neighbours>
    <agents_parent>
      <agent name="Robot1"/>
      <agent name="Robot3">
        <constraints>
          <constraint model="TKC" name="N1" reference="far" scope="V3 V9"/>
          <constraint model="TKC" name="N2" reference="far" scope="V9 V3"/>
        </constraints>
      </agent>
    </agents_parent>
    <agents_children/>
  </agents_neighbours>
</instance>
"""
"""A robot without a fault, for which the team has room."""

ADD_9 = f'<add_agent file="{LATE}"/>'


def add(agent: str, parent: str, *constraints: str) -> str:
    """Constraints that are added, each on a line of its own."""
    return "\n".join([f'<add_constraint agent="{agent}" parent="{parent}">', *constraints, "</add_constraint>"])


def constraint(scope: str, name: str = "N", reference: str = "ne", model: str = "TKC") -> str:
    return f'<constraint model="{model}" name="{name}" reference="{reference}" scope="{scope}"/>'


def change(name: str, text: str, *fragments: str, on: str = "", before: str = "") -> Broken:
    """One wrong change, and what is said of the line with `on` (the change itself, if that is one line)."""
    return files(name, {SCENARIO: scenario(before, text), LATE: ROBOT_9}, (SCENARIO, on or text, fragments))


def newcomer(name: str, edit: tuple[str, str], on: str, *fragments: str) -> Broken:
    """Something is wrong with the robot that is added, and said of its own file, or of the scenario (`on` is ADD_9)."""
    assert edit[0] in ROBOT_9
    file = SCENARIO if on == ADD_9 else LATE
    where = () if on == ADD_9 else ("scenario.xml:3",)
    return files(name, {SCENARIO: scenario(ADD_9), LATE: ROBOT_9.replace(*edit)}, (file, on, (*fragments, *where)))


GONE = '<remove_agent name="Robot3"/>'

ROBOTS = [
    change("a robot leaves that never was", '<remove_agent name="Robot_3"/>', "there is no robot 'Robot_3'"),
    change("a robot leaves twice", '<remove_agent  name="Robot3"/>', "no robot 'Robot3'", "at that time", before=GONE),
    change("nobody is left", '<remove_agent name="Robot1"/> <remove_agent name="Robot2"/>', "all robots have left",
           before=GONE, on="<event"),
    change("a robot with a long name leaves", f'<remove_agent name="{"R" * 5000}"/>', "no robot 'RRR", "...'"),
    change("a robot comes that is there", '<add_agent file="Robot2.xml"/>', "'Robot2' is already in the team"),
    change("a robot comes twice", '<add_agent  file="late/Robot9.xml"/>', "'Robot9' is already in", before=ADD_9),
    newcomer("a newcomer with a taken variable", ("V9", "V2"), ADD_9, "the variable 'V2' belongs to 'Robot2'"),
    newcomer("a newcomer of another kind", ("DisCSP", "DisWCSP"), ADD_9, "is a DisWCSP in a team of DisCSP"),
    newcomer("a newcomer with a child",
             ("<agents_children/>", '<agents_children><agent name="Robot2" variable="V9"/></agents_children>'),
             '<agent name="Robot2"', "has the child 'Robot2'", "list parents only"),
    newcomer("a newcomer's parent is not there", ('<agent name="Robot1"/>', '<agent name="Robot7"/>'),
             '<agent name="Robot7"', "there is no robot 'Robot7'"),
    newcomer("a newcomer's unknown variable", ("V3 V9", "V7 V9"), 'name="N1"', "no robot has the variable 'V7'"),
    newcomer("a newcomer's constraint with a stranger", ("V3 V9", "V2 V9"), 'name="N1"',
             "'V2' belongs to 'Robot2', which is not a parent of 'Robot9'"),
    newcomer("a newcomer's constraint under the wrong parent", ("V3 V9", "V1 V9"), 'name="N1"',
             "the scope of 'N1' lacks variables of 'Robot9' or 'Robot3'"),
    files("a newcomer with a PKC",
          {SCENARIO: scenario(ADD_9), LATE: ROBOT_9.replace('"TKC" name="N2"', '"PKC" name="N2"')},
          (LATE, 'name="N2"', ("partially known", 'write model="TKC"'))),
    files(
        "two mistakes of a newcomer, and what follows is not told",
        {
            SCENARIO: scenario(
                ADD_9,
                '<add_value variable="V9" value="9"/>',
                '<remove_constraint agent="Robot9" parent="Robot3" name="N2"/>',
                '<remove_agent name="Robot9"/>',
            ),
            LATE: ROBOT_9.replace("V3 V9", "V7 V9").replace('"Robot1"', '"Robot7"'),
        },
        (LATE, 'name="N1"', "no robot has the variable 'V7'"),
        (LATE, 'name="Robot7"', "there is no robot 'Robot7'"),
    ),
    files(
        "a newcomer whose file is broken, and what follows is not told",
        {
            SCENARIO: scenario(
                '<remove_agent name="Robot8"/>',
                ADD_9,
                '<add_value variable="V9" value="9"/>',
                add("Robot9", "Robot1", constraint("V1 V9", reference="far")),
                '<remove_agent name="Robot9"/>',
                '<remove_value variable="V1" value="9"/>',
            ),
            LATE: ROBOT_9.replace("1 3|3 1", "1|3 1").replace('"V9" domain="D1"', '"V9" domain="D2"'),
        },
        (SCENARIO, '"Robot8"', "there is no robot 'Robot8'"),
        (LATE, "<variable ", "unknown domain 'D2'"),
        (LATE, "<relation ", "the tuple '3 1' has 2 values"),
        (SCENARIO, '<remove_value variable="V1"', "'V1' has no value 9"),
    ),
    files(
        "a broken team, a broken newcomer, a broken scenario",
        {
            R1: TEAM[R1].replace("1..4", "4..1"),
            LATE: ROBOT_9.replace("1 3|3 1", "1|3 1"),
            SCENARIO: scenario(ADD_9, GONE, GONE, add("Robot3", "Robot2", constraint("V2 V3", reference="nee"))),
        },
        (R1, "<domain ", "4..1 is empty"),
        (LATE, "<relation ", "the tuple '3 1' has 2 values"),
        (SCENARIO, 'name="N"', "unknown reference 'nee'"),
    ),
]  # fmt: skip

SILENCE = [
    files(
        "a file that is not there, and what follows is not told",
        {
            SCENARIO: scenario(
                ADD_9,
                add("Robot9", "Robot3", constraint("V3 V9", reference="far")),
                '<remove_agent name="Robot9"/>',
            )
        },
        (SCENARIO, ADD_9, "there is no file"),
    ),
    files(
        "a robot that comes again from a broken file, and what follows is not told",
        {
            SCENARIO: scenario(
                '<remove_agent name="Robot3"/>',
                '<add_agent file="late/Robot3.xml"/>',
                add("Robot3", "Robot1", constraint("V1 V3", reference="far")),
            ),
            "late/Robot3.xml": "<instance>\n",
        },
        ("late/Robot3.xml", "", ":2: is not well-formed XML"),
    ),
    files(
        "a broken file of one who is there, whose definitions stay",
        {
            SCENARIO: scenario(
                '<add_agent file="late/Robot3.xml"/>',
                add("Robot3", "Robot1", constraint("V1 V3", reference="far")),
            ),
            "late/Robot3.xml": "<instance>\n",
        },
        ("late/Robot3.xml", "", ":2: is not well-formed XML"),
        (SCENARIO, 'name="N"', "unknown reference 'far'"),
    ),
    files(
        "one who is there comes, and the definitions of its file stay",
        {
            SCENARIO: scenario(
                '<add_agent file="late/Robot3.xml"/>',
                add("Robot3", "Robot2", constraint("W1 V2 V3", "N1", "sum"), constraint("V2 V3", "N2", "far")),
            ),
            "late/Robot3.xml": ROBOT_9.replace("Robot3", "Robot2").replace("V9", "V3").replace("V3 V3", "V2 V3"),
        },
        (SCENARIO, "<add_agent", "'Robot3' is already in the team"),
        (SCENARIO, '"N2"', "unknown reference 'far'"),
    ),
    files(
        "a constraint that cannot be read, and what follows is not told",
        {
            SCENARIO: scenario(
                add("Robot3", "Robot2", constraint("V2 V3", reference="nee")),
                '<remove_constraint agent="Robot3" parent="Robot2" name="N"/>',
            )
        },
        (SCENARIO, 'reference="nee"', "unknown reference 'nee'"),
    ),
    files(
        "nobody is left, and what follows is not told",
        {
            SCENARIO: scenario(*(f'<remove_agent name="Robot{number}"/>' for number in (1, 2, 3))).replace(
                "</scenario>", '<event after="solved"><remove_agent name="Robot1"/></event></scenario>'
            )
        },
        (SCENARIO, "<event", "all robots have left"),
    ),
]

VALUES = [
    change("a value goes that is not there", '<remove_value variable="V2" value="5"/>', "'V2' has no value 5",
           "its domain is 1..4 7 9"),
    change("a value goes twice", '<remove_value variable="V3"  value="4"/>', "'V3' has no value 4", "1..3",
           before='<remove_value variable="V3" value="4"/>'),
    change("a value comes that is there", '<add_value variable="V2" value="7"/>', "'V2' already has the value 7"),
    change("a value of nobody's variable", '<add_value variable="V9" value="7"/>', "no robot has the variable 'V9'"),
    change("a value of one who has left", '<add_value variable="V3" value="7"/>', "the variable 'V3'", before=GONE),
    change("a value that is none", '<add_value variable="V3" value="x"/>', "'x' is not an integer", "18 digits"),
]  # fmt: skip

CONSTRAINTS = [
    change("a constraint goes that is not there", '<remove_constraint agent="Robot2" parent="Robot1" name="C9"/>',
           "'Robot2' shares no constraint 'C9' with a parent 'Robot1'", "they share C1 C2 C3"),
    change("a constraint goes twice", '<remove_constraint agent="Robot2" parent="Robot1"  name="C3"/>',
           "shares no constraint 'C3'", "they share C1 C2)",
           before='<remove_constraint agent="Robot2" parent="Robot1" name="C3"/>'),
    change("a constraint goes, upside down", '<remove_constraint agent="Robot1" parent="Robot2" name="C1"/>',
           "'Robot1' shares no constraint 'C1' with a parent 'Robot2'", "the parent is the robot"),
    change("a constraint of nobody", add("Robot9", "Robot3", constraint("V3 V9")), "no robot 'Robot9'", on="<add_con"),
    change("a constraint with nobody", add("Robot3", "Robot9", constraint("V2 V3")), "no robot 'Robot9'",
           on='name="N"'),
    change("a constraint with oneself", add("Robot3", "Robot3", constraint("V2 V3")),
           "'Robot3' cannot be its own parent", on='name="N"'),
    change("a constraint that is held above", add("Robot1", "Robot2", constraint("V1 V2")),
           "'N' does not belong to 'Robot1' under 'Robot2'", "lowest robot of its scope, 'Robot2'",
           on='name="N"'),
    files(
        "wrong constraints, each on its line, and what follows is not told",
        {
            SCENARIO: scenario(
                add(
                    "Robot3",
                    "Robot1",
                    constraint("W1 V2 V3", "N1", "sum"),
                    constraint("V2 V3", "N2"),
                    constraint("V1 V9", "N3"),
                    constraint("V1 V9 V3", "N4", "sum"),
                    constraint("V1 V3", "N5", "p1"),
                    constraint("V1 V3", "N6", model="PKC"),
                    constraint("V1 V3 V1 V3", "N7"),
                    constraint("V1 V3", "N8"),
                ),
                '<remove_constraint agent="Robot3" parent="Robot1" name="N2"/>',
                '<remove_constraint agent="Robot3" parent="Robot1" name="N8"/>',
                '<remove_constraint agent="Robot3" parent="Robot1" name="N9"/>',
            )
        },
        (SCENARIO, '"N1"', ("'N1' does not belong to 'Robot3' under 'Robot1'", "the second lowest, 'Robot2'")),
        (SCENARIO, '"N2"', "the scope of 'N2' lacks variables of 'Robot3' or 'Robot1'"),
        (SCENARIO, '"N3"', ("'V1 V9' has no variable of this robot", "V3")),
        (SCENARIO, '"N4"', "no robot has the variable 'V9'"),
        (SCENARIO, '"N5"', ("unknown reference 'p1'", "known definitions: sum")),
        (SCENARIO, '"N6"', ("partially known constraint (PKC) in a scenario", 'write model="TKC"')),
        (SCENARIO, '"N7"', "ne requires 2 terms"),
        (SCENARIO, '"N9"', "shares no constraint 'N9'"),
    ),
    change("a definition of another robot's file", add("Robot3", "Robot2", constraint("V2 V3", reference="r1")),
           "unknown reference 'r1'", on='name="N"'),
    change("a definition that left with its robot", add("Robot2", "Robot1", constraint("V1 V2", reference="far")),
           "unknown reference 'far'", on='name="N"', before=f'{ADD_9}\n<remove_agent name="Robot9"/>'),
]  # fmt: skip

CHANGES = [*ROBOTS, *SILENCE, *VALUES, *CONSTRAINTS]
