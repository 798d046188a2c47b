"""What the fork server does when it ends, which is when the parent has: remove the parent's temporary folder.

Imported there alone. A parent that was killed could not do it; the router does so too, but only while there is one.
"""

from __future__ import annotations

import atexit
import os
import shutil

SCRATCH = "ROBOCHOC_SCRATCH"
"""The environment's variable by which the parent says which folder that is."""

if _scratch := os.environ.pop(SCRATCH, ""):
    atexit.register(shutil.rmtree, _scratch, ignore_errors=True)
