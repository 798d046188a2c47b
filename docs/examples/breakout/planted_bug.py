"""A planted bug, which appears only if a message arrives early, and the order of messages in which it appears."""

from __future__ import annotations

from printing import show
from robochoc_breakout import Breakout

from robochoc.testing import check_protocol


class Forgetful(Breakout):
    """Forgets the improvements of neighbours that are ahead."""

    def _send_improve(self) -> None:
        super()._send_improve()
        self._improves = {}


def main() -> None:
    """Print the fault that the check finds."""
    try:
        check_protocol(Forgetful, states=3000)
    except AssertionError as fault:
        show(fault)


if __name__ == "__main__":
    main()
