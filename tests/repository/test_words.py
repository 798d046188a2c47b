"""Turns of phrase that readers had to decipher do not spread: their numbers may only fall.

Write the usual noun or verb in their place: "Return the attachment of the message", "is not a valid TOML file",
"this robot's cost". Where you have removed some, lower the number here.
"""

from __future__ import annotations

import re
from collections import Counter

from tests.support.program import ROOT

MOST = {
    r"\bReturns? (what|who|whether or not)\b": 1,
    r'"""(What|Who|Whoever|Whatever|So many|Of these)\b': 2,
    r"\b(the|an) own\b": 4,
    r"(?<![Tt]here )\b(is|are) no (?!longer|more|less|way|one|need|such|use\b|different|other)[a-z]+": 10,
    r"\b[Ww]hoever\b": 0,
    r"\banew\b": 45,
    r"\bgo(es)? with(?!out)\b": 3,
    r"\b(is|are|was|were) told\b": 1,
    r"\bheard\b": 17,
    r"\bstands? (for|beside|there|once)\b": 7,
    r"\bso many\b": 6,
    r"\bstrangers?\b": 3,
    r"\b[Tt]he house's\b|\bof this house\b": 0,
}
"""The highest number of places in the package, in code, comments and texts."""


def test_unclear_turns_do_not_spread() -> None:
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "robochoc").rglob("*.py")]
    found = Counter({turn: sum(len(re.findall(turn, text)) for text in texts) for turn in MOST})
    assert {turn: (found[turn], most) for turn, most in MOST.items() if found[turn] > most} == {}
