"""The options of a run, and the equivalent command line."""

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
"""The maximum time limit in seconds."""


class RunOptions(msgspec.Struct, frozen=True):
    """The options of a run.

    Attributes:
        protocol: The protocol; `auto`: chosen to suit the team's problem.
        runtime: `simulator` or `processes`.
        seed: The random seed.
        timeout: The time limit in seconds. None: no limit.
        withdraw: True if robots withdraw if there is no solution, with the least total weight.
        more: Further arguments of `robochoc solve`.
    """

    protocol: str = AUTO
    runtime: str = Runtime.SIMULATOR
    seed: int = 0
    timeout: float | None = None
    withdraw: bool = False
    more: tuple[str, ...] = ()

    def arguments(self, team: str, *, ranked: bool = False) -> list[str]:
        """Return the arguments for `robochoc` that solve the team in the folder `team`, inside the folder of a run.

        If the team is `ranked`, the order of the robots is the order in the files.
        """
        arguments = ["solve", team, "--json", "--journal", JOURNAL]
        arguments += ["--protocol", self.protocol, "--runtime", self.runtime, "--seed", str(self.seed)]
        if ranked:
            arguments += ["--order", Order.GIVEN]
        if self.timeout is not None:
            arguments += ["--timeout", f"{self.timeout:g}"]
        arguments.append("--withdraw" if self.withdraw else "--bounds")  # the costs of withdrawals are not the user's
        return [*arguments, *self.more]

    @property
    def are_known(self) -> bool:
        """True if the application could have set these options; an opened file may contain any options."""
        return (
            self.protocol in {AUTO, *protocol_names()}
            and self.runtime in {Runtime.SIMULATOR, Runtime.PROCESSES}
            and 0 <= self.seed <= MAX_SEED
            and (self.timeout is None or 0 < self.timeout <= MAX_TIMEOUT_S)
            and not self.more
        )


def command_line(arguments: Sequence[str]) -> str:
    """Return the shell command for arguments of `robochoc`."""
    return shlex.join(["robochoc", *arguments])
