"""The scripts that a page needs to show a scene: meshcat's viewer, and labels that can be read."""

from __future__ import annotations

from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path


def viewer_script() -> str:
    """Return the JavaScript of meshcat's viewer, three.js included.

    meshcat itself is not imported, which takes long: this is a file of it. Raises `ModuleNotFoundError`.
    """
    found = find_spec("meshcat")
    if found is None or not found.submodule_search_locations:
        raise ModuleNotFoundError("meshcat, whose viewer draws the scene, is not installed", name="meshcat")
    viewer = Path(found.submodule_search_locations[0]) / "viewer" / "dist" / "main.min.js"
    return viewer.read_text(encoding="utf-8")


def labels_script() -> str:
    """Return the JavaScript that chooses which labels of a scene are shown, and how large."""
    return (files(__package__) / "labels.js").read_text(encoding="utf-8")
