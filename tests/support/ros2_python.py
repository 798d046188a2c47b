"""A Python that has a real rclpy, and robochoc's own dependencies: this one, or the one that a variable names."""

from __future__ import annotations

import importlib.machinery
import os
import sys

import pytest

from tests.support.dds import free_domain
from tests.support.program import ROOT

VARIABLE = "ROBOCHOC_ROS2_PYTHON"


def ros2_python() -> tuple[str, dict[str, str]]:
    """Return that Python and its environment, in a domain that nobody is in; skip the test where there is none."""
    python = os.environ.get(VARIABLE, "")
    if not python and importlib.machinery.PathFinder.find_spec("rclpy") is None:
        pytest.skip(f"no rclpy here: source a ROS 2, or name a Python that has one and robochoc in {VARIABLE}")
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    return python or sys.executable, {**os.environ, "PYTHONPATH": path, "ROS_DOMAIN_ID": str(free_domain())}
