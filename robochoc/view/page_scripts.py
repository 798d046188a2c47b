"""The scripts of a page with a scene, and its Content-Security-Policy.

With this policy, a browser loads nothing, and runs only the scripts of the page, identified by their hashes. Markup in
names from foreign files remains text.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path


def viewer_script() -> str:
    """Return the JavaScript of meshcat's viewer, three.js included.

    It is read from a file of meshcat, which is not imported, since that takes long. Raises `ModuleNotFoundError`.
    """
    found = find_spec("meshcat")
    if found is None or not found.submodule_search_locations:
        raise ModuleNotFoundError("the 3D scene requires the viewer of meshcat, which is not installed", name="meshcat")
    viewer = Path(found.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js"
    return viewer.read_text(encoding="utf-8")


def labels_script() -> str:
    """Return the JavaScript that chooses the visible labels of a scene, and their sizes."""
    return (files(__package__) / "labels.js").read_text(encoding="utf-8")


def content_security_policy(scripts: Iterable[str], connections: str = "'none'") -> str:
    """Return the policy of a page with these `scripts`, which may connect to `connections` (in the syntax of CSP).

    Inline styles are allowed, since meshcat's viewer creates some.
    """
    hashes = " ".join(map(_hashed, scripts))
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline';"
        f" img-src data: blob:; connect-src {connections}; base-uri 'none'; form-action 'none'"
    )


def _hashed(script: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
