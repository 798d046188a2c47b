"""BLAKE2b without OpenSSL, whose loading takes 4 ms: `hashlib` uses this implementation, too."""

from __future__ import annotations

try:
    from _blake2 import blake2b
except ImportError:  # another implementation of Python
    from hashlib import blake2b

__all__ = ["blake2b"]
