"""All exceptions have one base class, so that users can catch them, and other processes can receive them."""

from __future__ import annotations

import builtins
import re

from tests.support.program import ROOT

BASE = "RobochocError"
CLASS = re.compile(r"^class ([A-Z]\w*Error)\(([^()]*)\):", re.MULTILINE)


def test_every_public_exception_is_a_robochoc_error() -> None:
    known = {name for name in vars(builtins) if name.endswith("Error")} | {"Exception"}
    found: dict[str, list[str]] = {}
    for path in (ROOT / "robochoc").rglob("*.py"):
        for name, bases in CLASS.findall(path.read_text(encoding="utf-8")):
            found.setdefault(name, []).extend(base.strip().split(".")[-1] for base in bases.split(","))
    assert len(found) > 80
    outside = [name for name, bases in found.items() if name != BASE and not ({*bases} - known)]
    assert not outside, f"derive these from {BASE}: {outside}"
    assert {base for bases in found.values() for base in bases} - known <= found.keys()
