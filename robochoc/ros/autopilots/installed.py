"""Whether MAVSDK is there: the guard's process imports it, not the one that starts the guard."""

from __future__ import annotations

import importlib.util


def require_mavsdk() -> None:
    """Raise `ModuleNotFoundError` where MAVSDK is not installed."""
    if importlib.util.find_spec("mavsdk") is None:
        raise ModuleNotFoundError("No module named 'mavsdk'", name="mavsdk")
