"""Damaged ZIP archives."""

from __future__ import annotations

import zipfile
import zlib

DAMAGED = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError, OSError)
"""The exceptions that a damaged archive can cause; a `RuntimeError` is an unsupported or encrypted one."""
