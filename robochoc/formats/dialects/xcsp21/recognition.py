"""What the first bytes of a file say of it, before it is parsed."""

from __future__ import annotations

import re

_COMMENT = re.compile(rb"<!--.*?-->|<\?.*?\?>|\xef\xbb\xbf", re.DOTALL)
_ROOT = re.compile(rb"\s*<([A-Za-z_][^\s/>]*)([^>]*)>")
_PRESENTATION = re.compile(rb"<presentation\b([^>]*)>")
_ATTRIBUTE = re.compile(rb"\b([A-Za-z]+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")


class Beginning:
    """The first bytes of a file.

    Attributes:
        is_instance: Whether its root element is `instance`, and not XCSP3's.
        format: The format that its presentation names. Empty: none.
        type: The type that its presentation names. Empty: none.
        has_agents: Whether it lists agents: robots' own files do not.
        is_network: Whether it lists domains and variables, and has nothing of a robot's own file.
    """

    def __init__(self, beginning: bytes) -> None:
        text = _COMMENT.sub(b"", beginning)
        root = _ROOT.match(text)
        self.is_instance = bool(root and root[1] == b"instance" and b"XCSP3" not in root[2])
        presentation = _PRESENTATION.search(text)
        found = _ATTRIBUTE.findall(presentation[1] if presentation else b"")
        stated = {name: one or other for name, one, other in found}
        self.format = stated.get(b"format", b"").decode("utf-8", "replace").strip()
        self.type = stated.get(b"type", b"").decode("utf-8", "replace").strip()
        is_own = b"<agents_neighbours" in text or self.type in {"DisCSP", "DisWCSP"}
        self.is_network = not is_own and all(part in text for part in (b"<domains", b"<variables", b"<variable "))
        self.has_agents = re.search(rb"<agents[\s/>]", text) is not None and b"<agents_neighbours" not in text
