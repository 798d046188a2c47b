"""Files that are no robots: the file itself, its XML, its schema."""

from __future__ import annotations

import os
from pathlib import Path

from tests.support.broken_case import R1, R2, R3, ROBOT_1, ROBOT_3, TOLD, case, files, other, write_files

BOMB = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [<!ENTITY a "lol">'
    + "".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9))
    + "]>\n<instance>&j;</instance>\n"
)


def huge(folder: Path) -> None:
    """A file of 10 GB, without a byte on the disk."""
    with (folder / "X.xml").open("wb") as file:
        file.truncate(10**10)


FILES = [
    other("a missing folder", lambda _: None, ("nowhere", "", ("does not exist", "generate queens3d")),
          target="nowhere"),
    other("a file for a folder", lambda _: None, (R1, "", "is not a folder"), target=R1),
    other("an empty folder", lambda folder: (folder / "empty").mkdir(), ("empty", "", ("no team", "generate")),
          target="empty"),
    other("a scenario alone", lambda folder: write_files(folder / "alone", {"scenario.xml": "<scenario/>"}),
          ("alone", "", "no robot"), target="alone"),
    other("a folder called X.xml", lambda folder: (folder / "X.xml").mkdir(), ("X.xml", "", "not a regular file")),
    other("a FIFO", lambda folder: os.mkfifo(folder / "X.xml"), ("X.xml", "", "not a regular file")),
    other("a device", lambda folder: (folder / "X.xml").symlink_to("/dev/zero"), ("X.xml", "", "not a regular file")),
    other("a link to nothing", lambda folder: (folder / "X.xml").symlink_to("nothing"), ("X.xml", "", "No such file")),
    other("a huge file", huge, ("X.xml", "", "larger than 16 MiB")),
    files("an empty file", {R3: ""}, (R3, "", "is empty")),
    files("blanks only", {R3: " \n "}, (R3, "", "is empty")),
    files("not UTF-8", {R3: ROBOT_3.replace("drone3", "dröne3").encode("latin-1")}, (R3, "", ":11: is not UTF-8")),
    files("UTF-16", {R3: ROBOT_3.encode("utf-16")}, (R3, "", ":1: is not UTF-8")),
    files("a name that is none", {"3 Robots.xml": ROBOT_1},
          ("3 Robots.xml", "", ("cannot be a robot's name", "rename"))),
]  # fmt: skip

WELL_FORMED = [
    files("truncated", {R3: ROBOT_3[:-60]}, (R3, "", (":33: is not well-formed XML", "complete"))),
    case("a tag closed by another", [(R3, "</topics>", "</topic>")], (R3, "</topic>", "not well-formed XML")),
    case("the printed slip of Figure 2", [(R1, TOLD, TOLD[:-1])],
         (R1, TOLD[:-1], ("not well-formed XML", "end the tag with >"))),
    files("no XML at all", {R3: "hello\n"}, (R3, "hello", "not well-formed XML")),
    files("NUL bytes", {R3: b"\0" * 1000}, (R3, "", ":1: is not well-formed XML")),
    files("two roots", {R3: ROBOT_3 + "<instance/>\n"}, (R3, "", (":37: is not well-formed XML", "one root"))),
    files("deep XML", {R3: "<a>" * 100_000 + "</a>" * 100_000},
          (R3, "", ":1: is not well-formed XML: Excessive depth in document: 256 (a robot")),
    files("a file of the system as entity (XXE)",
          {R3: '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]>\n<instance>&e;</instance>'},
          (R3, "<!DOCTYPE", "DOCTYPE is not accepted")),
    files(
        "an external DTD",
        {R3: '<?xml version="1.0"?>\n<!-- - -->\n<!DOCTYPE instance SYSTEM "http://127.0.0.1:9/x.dtd">\n<instance/>'},
        (R3, "<!DOCTYPE", "DOCTYPE is not accepted"),
    ),
    files("a billion laughs", {R3: BOMB}, (R3, "<!DOCTYPE", "DOCTYPE is not accepted")),
    files("an entity of one's own", {R3: "<instance>\n&e;</instance>"}, (R3, "&e;", ("not well-formed XML", "&lt;"))),
]  # fmt: skip

SCHEMA = [
    files("another root", {R3: "<robot/>"}, (R3, "<robot/>", ("root element is <robot>", "expected <instance>"))),
    files("a namespace", {R3: ROBOT_3.replace("<instance>", '<instance xmlns="urn:x">')},
          (R3, "<instance", "XML namespace")),
    case("an unknown element", [(R3, "<topics nbTopics", "<topix/><topics nbTopics")],
         (R3, "<topix/>", ("<topix> does not belong in <instance>", "<topics> or <relations>"))),
    case("an element twice", [(R3, "<presentation", '<presentation type="DisCSP"/><presentation')],
         (R3, "<presentation", "a second <presentation>")),
    case("a missing element", [(R3, '<presentation type="DisCSP"/>', "")], (R3, "<instance>", "lacks <presentation>")),
    case("an unknown kind", [(R3, '"DisCSP"', '"CSP"')], (R3, "<presentation", ('type="CSP"', "'DisCSP', 'DisWCSP'"))),
    case("an unknown attribute", [(R3, 'z="V3"', 'w="V3"')], (R3, "<topic ", "<topic> has no attribute 'w'")),
    case("a misspelt attribute", [(R3, "type=", "typ=")],
         (R3, "<presentation", "<presentation> has no attribute 'typ'")),
    case("a missing attribute", [(R3, ' domain="D1"', "")], (R3, "<variable ", "lacks its attribute 'domain'")),
    case("a name with a blank", [(R3, 'name="V3"', 'name="V 3"')],
         (R3, "<variable ", ('name="V 3"', "a letter, then"))),
    case("a count that is none", [(R3, 'nbTopics="1"', 'nbTopics="one"')],
         (R3, "<topics", ('nbTopics="one"', "a number"))),
    *(
        case(
            f"a weight of {weight[:7]}",
            [(R3, 'type="DisCSP"', f'type="DisCSP" weight="{weight}"')],
            (R3, "<presentation", ('weight="' + weight[:7], "in <presentation> is not allowed", "from 1 to 1000000")),
        )
        for weight in ("0", "-1", "x", "1.5", "", "1000001", "9" * 5000, "it's")
    ),
    case("text where none belongs", [(R3, "<topic ", "here <topic ")], (R3, "<topics", "<topics> contains text")),
    case("an element in a text", [(R2, ">1..4 7 9<", "><b/><")], (R2, "<b/>", "<domain> contains an element")),
    case("MathML", [(R2, "functional>", "mathml>")], (R2, "<mathml>", ("<mathml> does not belong", "<functional>"))),
]  # fmt: skip
