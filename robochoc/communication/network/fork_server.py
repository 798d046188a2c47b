"""The last action of the fork server, when its parent has ended: remove the parent's temporary folder.

Only the fork server imports this module. A parent that was killed cannot remove the folder. The router removes it too,
but not every run has a router.
"""

from __future__ import annotations

import atexit
import os
import shutil

SCRATCH = "ROBOCHOC_SCRATCH"
"""The environment's variable by which the parent says which folder that is."""

if _scratch := os.environ.pop(SCRATCH, ""):
    atexit.register(shutil.rmtree, _scratch, ignore_errors=True)
