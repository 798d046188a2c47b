"""Views of XML elements: a part that no reader has read is an error, and a part that was read is none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from random import Random
from xml.sax.saxutils import quoteattr

import pytest

from robochoc.formats.diagnostics import InvalidInputError, MistakeError
from robochoc.formats.element_view import MAX_DEPTH, ElementView, open_xml
from tests.support.cases import looped

SHOP = """<shop open='yes'>
  <item price='3'> bread </item>
  <item price='4'> milk </item>
  <note> closed on Sunday </note>
</shop>
"""


def mistakes(path: Path, xml: str, reader: Callable[[ElementView], object]) -> list[tuple[int, str, str]]:
    """Return line, message and hint of each mistake when `reader` reads `xml`."""
    file = path / "file.xml"
    file.write_text(xml)
    try:
        with open_xml(file, 10_000_000) as root:
            reader(root)
    except InvalidInputError as error:
        return [(one.line, one.message, one.hint) for one in error.diagnostics if one.file == str(file)]
    return []


def read_shop(root: ElementView) -> None:
    root.attribute("open")
    for item in root.children("item"):
        with item.guard():
            price, name = item.attribute("price"), item.text()
            if not price.isdecimal():
                raise MistakeError(f"the price {price} of {name}", "write a number")
    root.ignore("note")


def test_a_file_whose_parts_are_all_read_has_no_mistake(tmp_path: Path) -> None:
    assert mistakes(tmp_path, SHOP, read_shop) == []


@looped(
    ("old", "new", "expected"),
    [
        ("price='4'", "price='4' colour='red'", (3, "the attribute 'colour' is not supported in <item>", "known")),
        ("open=", "opened=", (1, "the attribute 'opened' is not supported in <shop>", "did you mean 'open'?")),
        ("<note>", "<itme/><note>", (4, "<itme> is not supported in <shop>", "did you mean 'item'?")),
        (
            "<note>",
            "once <note>",
            (3, "<shop> contains the text 'once'", "delete it: only elements are expected there"),
        ),
        (" milk ", "<b>milk</b>", (3, "<b> is not allowed inside <item>", "write only text there")),
        ("'4'", "'four'", (3, "the price four of milk", "write a number")),
    ],
)
def test_a_part_that_is_not_read_is_named_with_its_line(
    old: str, new: str, expected: tuple[int, str, str], tmp_path: Path
) -> None:
    ((line, message, hint),) = mistakes(tmp_path, SHOP.replace(old, new), read_shop)
    assert (line, message) == expected[:2]
    assert hint.startswith(expected[2])


def test_all_mistakes_are_reported_but_no_consequences_of_one(tmp_path: Path) -> None:
    wrong = SHOP.replace("price='3'", "price='three' colour='red'").replace("<note>", "<itme/><note>")
    found = mistakes(tmp_path, wrong, read_shop)
    assert [message for _, message, _ in found] == ["the price three of bread", "<itme> is not supported in <shop>"]


def test_a_misspelt_child_is_named_where_the_right_one_is_missing(tmp_path: Path) -> None:
    found = mistakes(tmp_path, "<a><conditon/></a>", lambda root: root.required("condition"))
    assert found == [(1, "<a> has no <condition>", "write 'condition' instead of 'conditon'")]


def test_a_second_child_is_refused(tmp_path: Path) -> None:
    found = mistakes(tmp_path, "<a>\n<b/>\n<b/></a>", lambda root: root.child("b"))
    assert found == [(3, "<a> has a second <b>", "keep one of them")]


def test_a_child_that_was_asked_for_but_not_read_is_refused(tmp_path: Path) -> None:
    found = mistakes(tmp_path, "<a><b/></a>", lambda root: root.has("b"))
    assert found == [
        (1, "<b> is not supported in <a>", "it is not supported together with the other parts of this <a>")
    ]


def test_texts_and_elements_in_turn(tmp_path: Path) -> None:
    pieces: list[str] = []

    def read(root: ElementView) -> None:
        pieces.extend(piece.strip() if isinstance(piece, str) else f"<{piece.tag}>" for piece in root.mixed())

    assert mistakes(tmp_path, "<a> [ 1 2 <le/> 5 <!-- no --> ] </a>", read) == []
    assert pieces == ["[ 1 2", "<le>", "5  ]"]
    ((_, message, _),) = mistakes(tmp_path, "<a> 1 <le strict='yes'/> </a>", read)
    assert message == "the attribute 'strict' is not supported in <le>"


def test_attributes_about_the_document_are_no_contents(tmp_path: Path) -> None:
    xml = "<a xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance' xsi:noNamespaceSchemaLocation='a.xsd' xml:id='x'/>"
    assert mistakes(tmp_path, xml, lambda root: root.tag) == []


@pytest.mark.parametrize("levels", [MAX_DEPTH, MAX_DEPTH + 1, 200])
def test_the_depth_of_elements_is_bounded(levels: int, tmp_path: Path) -> None:
    def read(view: ElementView) -> None:
        for child in view.children("a"):
            with child.guard():
                read(child)

    found = mistakes(tmp_path, "\n".join(["<a>"] * levels + ["</a>"] * levels), read)
    deep = [(MAX_DEPTH, f"elements are nested deeper than {MAX_DEPTH} levels", "use fewer levels")]
    assert found == ([] if levels == MAX_DEPTH else deep)


def test_a_reader_that_reads_nothing_has_a_mistake_for_each_part(tmp_path: Path) -> None:
    found = mistakes(tmp_path, SHOP, lambda root: root.tag)
    assert [line for line, _, _ in found] == [1, 2, 3, 4]


def test_random_trees_with_one_part_that_no_reader_knows(tmp_path: Path) -> None:
    """Whatever the tree is, and wherever an unknown part is inserted, it is the one mistake."""

    def read(view: ElementView) -> None:
        view.attribute("known")
        if view.has_children:
            for child in view.children("x", "y"):
                read(child)
        else:
            view.text()

    for seed in range(100):
        random = Random(seed)
        places = 1 + random.randrange(12)
        parents = {place: random.randrange(place) for place in range(1, places)}
        chosen, kind = random.randrange(places), random.choice(["element", "attribute", "text", "none"])

        def written(
            place: int, parents: dict[int, int] = parents, chosen: int = chosen, kind: str = kind, seed: int = seed
        ) -> str:
            inner = "".join(written(other) for other, parent in parents.items() if parent == place)
            strange = f" strange={quoteattr(str(seed))}" if (place, kind) == (chosen, "attribute") else ""
            if place == chosen and kind in {"element", "text"}:
                inner += "<strange/>" if kind == "element" else ("<x/>text" if not inner else "text")
            return f"<{'xy'[place % 2]} known='1'{strange}>{inner}</{'xy'[place % 2]}>"

        found = mistakes(tmp_path, written(0), read)
        assert len(found) == (kind != "none"), (seed, kind, found)
        if found and kind != "text":
            assert "strange" in found[0][1]
