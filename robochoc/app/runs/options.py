"""How a team is to decide, and the command line that says so."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import msgspec

from robochoc.model.orders import Order
from robochoc.run.defaults import AUTO
from robochoc.run.options import Runtime
from robochoc.run.registry import protocol_names

RESULT = "result.json"
JOURNAL = "run.journal"
MAX_SEED = 2**31 - 1
MAX_TIMEOUT_S = 1e9
"""A longer limit is none that anybody meant."""


class RunOptions(msgspec.Struct, frozen=True):
    """How a team is to decide.

    Attributes:
        protocol: The protocol; `auto`: one that suits the team.
        runtime: `simulator` or `processes`.
        seed: The seed of what is random.
        timeout: A limit in seconds. None: no limit.
        withdraw: Whether robots may step aside where there is no solution: as few as possible, by weight.
        more: Further arguments of `robochoc solve`.
    """

    protocol: str = AUTO
    runtime: str = Runtime.SIMULATOR
    seed: int = 0
    timeout: float | None = None
    withdraw: bool = False
    more: tuple[str, ...] = ()

    def arguments(self, team: str, *, ranked: bool = False) -> list[str]:
        """Return the arguments of `robochoc` that let the folder `team` decide, in the folder of a run.

        Where the team is `ranked`, robots decide in their own order, and no protocol chooses another one.
        """
        said = ["solve", team, "--json", "--journal", JOURNAL]
        said += ["--protocol", self.protocol, "--runtime", self.runtime, "--seed", str(self.seed)]
        if ranked:
            said += ["--order", Order.GIVEN]
        if self.timeout is not None:
            said += ["--timeout", f"{self.timeout:g}"]
        said.append("--withdraw" if self.withdraw else "--bounds")  # with it, costs mean another thing
        return [*said, *self.more]

    @property
    def are_known(self) -> bool:
        """Whether the application could have set them itself: those of a stranger's file may say anything."""
        return (
            self.protocol in {AUTO, *protocol_names()}
            and self.runtime in {Runtime.SIMULATOR, Runtime.PROCESSES}
            and 0 <= self.seed <= MAX_SEED
            and (self.timeout is None or 0 < self.timeout <= MAX_TIMEOUT_S)
            and not self.more
        )


def command_line(arguments: Sequence[str]) -> str:
    """Return a command line as it can be typed in a shell, for arguments of `robochoc`."""
    return shlex.join(["robochoc", *arguments])
