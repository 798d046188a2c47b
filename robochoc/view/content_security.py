"""The Content-Security-Policy of pages: what a browser lets them do.

Nothing is loaded from anywhere, and no script runs but those that the page was made with, known by their hashes. What
names from foreign files might smuggle into a page stays text.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable


def content_security_policy(scripts: Iterable[str], connections: str = "'none'") -> str:
    """Return the policy of a page with these `scripts`, which may connect to `connections` (in CSP's form).

    Styles may be inline, as meshcat's viewer makes some of its own.
    """
    hashes = " ".join(map(_hashed, scripts))
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline';"
        f" img-src data: blob:; connect-src {connections}; base-uri 'none'; form-action 'none'"
    )


def _hashed(script: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
