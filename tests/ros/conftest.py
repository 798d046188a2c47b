"""Fixtures of the tests of ROS: a zenoh router, a far end that is not ours, and no ROS sourced."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.support.zenoh_ros2 import FarEnd, Router


@pytest.fixture
def no_ros_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Remove what a ROS that was sourced has left in the environment."""
    from robochoc.ros.live import rmw_zenoh_session  # noqa: PLC0415 - other tests of ROS need no zenoh

    for name in ("ROS_DOMAIN_ID", "ROS_DISTRO", rmw_zenoh_session.CONFIG_FILE):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="module")
def router() -> Iterator[Router]:
    """A zenoh router in a process of its own."""
    with Router() as router:
        yield router


@pytest.fixture(scope="module")
def end(router: Router) -> Iterator[FarEnd]:
    """The far end of rmw_zenoh, by zenoh-ros2-sdk."""
    pytest.importorskip("zenoh_ros2_sdk")
    with FarEnd(router) as end:
        yield end
