"""The page about sketches has every rule of the palette, in its words, and the bounds as they are.

`python -m tests.docs.test_sketches_page` writes what is to stand there.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator

from robochoc.app.sketch import element_checks, open_from_disk, rule_checks
from robochoc.app.sketch import sketch as limits
from robochoc.app.sketch.palette import ALL_KINDS, Links
from robochoc.app.sketch.rules import PALETTE
from robochoc.app.texts import say
from tests.support.program import ROOT

PAGE = ROOT / "docs/reference/sketches.md"
_LINKS = {
    Links.EACH: "each robot",
    Links.PAIRS: "every two",
    Links.NEIGHBOURS: "every two neighbours",
    Links.STAR: "the first and each other",
    Links.CHAIN: "each and the next",
    Links.GROUP: "all together",
}


def rules() -> Iterator[str]:
    """The rows of the palette."""
    for key, entry in PALETTE.items():
        kinds = sorted(say(f"kind.{kind}").lower() for kind in entry.kinds)
        fits_all = "everything" if entry.kinds == ALL_KINDS else ", ".join(kinds)
        yield f"| {say(f'rule.{key}.name')} | {fits_all} | {_LINKS[entry.links]} | {say(f'rule.{key}.help')} |"


def bounds() -> Iterator[str]:
    """The rows of the bounds."""
    found = (
        ("robots", limits.MAX_ROBOTS),
        ("columns, and rows, of a map", limits.MAX_SIDE),
        ("decisions", limits.MAX_DECISIONS),
        ("values of a decision", limits.MAX_VALUES),
        ("a number that is a value", element_checks.MAX_NUMBER),
        ("rules", limits.MAX_RULES),
        ("constraints that all rules become", rule_checks.MAX_LINKS),
        ("robots of a rule about all together", rule_checks.MAX_GROUP),
        ("files of a team that is opened", open_from_disk.MAX_FILES),
    )
    yield from (f"| {what} | {most:,} |" for what, most in found)


def written(page: str) -> str:
    """The page with the rows as they are now."""
    head = "| rule | fits | one constraint for | what it says |\n| --- | --- | --- | --- |\n"
    page = _between(page, "palette", head + "\n".join(rules()))
    return _between(page, "bounds", "| what | at most |\n| --- | --- |\n" + "\n".join(bounds()))


def _between(page: str, mark: str, text: str) -> str:
    begin, end = f"<!-- {mark} -->\n\n", f"\n\n<!-- /{mark} -->"
    return re.sub(f"{re.escape(begin)}.*?{re.escape(end)}", lambda _: begin + text + end, page, flags=re.DOTALL)


def test_the_page_has_every_rule_and_the_bounds_as_they_are() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert page == written(page)
    assert all(row in page for row in (*rules(), *bounds()))


if __name__ == "__main__":
    argparse.ArgumentParser(description="Write the tables of the page on sketches anew.").parse_args()
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
