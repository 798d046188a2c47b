"""Smart grid: homes start their devices so that little energy comes from the main grid.

The problem of the environment SmartGrid in CoLLAB: Mahmud, Bagdasarian and Zilberstein, "CoLLAB: a framework for
designing scalable benchmarks for agentic LLMs", 2025 (also in Terrarium, arXiv 2510.14312). A robot is a home with a
variable for each device: the slot in which the device starts. In each slot there is some sustainable energy, and the
cost is the consumption that exceeds it, summed over all slots. In the paper the supply follows a sine with noise, and a
single factor joins all devices; here the supply rises to the middle of the day and falls, in integers, and there is one
constraint for each slot, over the devices that can run in it.
"""

from __future__ import annotations

from robochoc.generators.draws import MAX_AGENTS, MAX_COST, check_bounds, limited, random_integer, seeded
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Expression, Name, total
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Team, Variable
from robochoc.system.lazy_dataclass import dataclass

MAX_SLOTS = 1000
MAX_DEVICES = 10
MAX_COMBINATIONS = 1_000_000
"""The maximum number of combinations of starts of the devices in a constraint."""


@dataclass(frozen=True)
class Device:
    """A device: its variable, its possible starts, its duration in slots and its consumption per slot."""

    variable: str
    starts: range
    duration: int
    consumption: int

    def can_run(self, slot: int) -> bool:
        """Return whether the device can run in a slot."""
        return self.starts.start <= slot < self.starts.stop - 1 + self.duration

    def consumed(self, slot: int) -> Expression:
        """Return the consumption in a slot, as an expression in the device's start."""
        began = Apply("le", (Name(self.variable), Constant(slot)))
        runs_on = Apply("gt", (Name(self.variable), Constant(slot - self.duration)))
        return Apply("if", (Apply("and", (began, runs_on)), Constant(self.consumption), Constant(0)))


def smart_grid(
    *,
    agents: int,
    devices: int = 2,
    slots: int = 24,
    window: int = 3,
    duration: int = 3,
    consumption: int = 30,
    supply: int = 40,
    seed: int = 0,
) -> Team:
    """Return a random smart grid problem.

    `Robot3` owns `V3.1`, `V3.2`, ...

    Args:
        agents: The number of homes.
        devices: The number of devices of a home.
        slots: The number of time slots, which are numbered from 1.
        window: The number of slots in which a device can start.
        duration: The maximum number of slots for which a device runs.
        consumption: The maximum consumption of a device in a slot, in units of 100 W.
        supply: The largest sustainable energy in a slot, in the same unit.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds, or too many devices can run in the same slot.
    """
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "devices": (devices, 1, MAX_DEVICES)})
    check_bounds({"slots": (slots, 2, MAX_SLOTS), "duration": (duration, 1, MAX_SLOTS)})
    check_bounds({"window": (window, 1, MAX_SLOTS), "consumption": (consumption, 1, MAX_COST)})
    check_bounds({"supply": (supply, 0, MAX_COST)})
    if duration > slots:
        raise ValueError(f"duration is {duration}, but there are only {slots} slots: use more slots, or a shorter one")
    if (starts := slots - duration + 1) < window:
        raise ValueError(
            f"window is {window}, but a device that runs for {duration} of the {slots} slots can start in only {starts}"
            " of them: use more slots, a shorter duration or a smaller window"
        )
    chance = seeded(seed)
    homes: dict[str, list[Device]] = {}
    for home in range(1, agents + 1):
        homes[f"Robot{home}"] = []
        for number in range(1, devices + 1):
            first = random_integer(chance, 1, slots - duration - window + 2)
            runs, consumed = random_integer(chance, 1, duration), random_integer(chance, 1, consumption)
            homes[f"Robot{home}"].append(Device(f"V{home}.{number}", range(first, first + window), runs, consumed))
    everything = [device for own in homes.values() for device in own]
    constraints = []
    for slot in range(1, slots + 1):
        running = [device for device in everything if device.can_run(slot)]
        if window ** len(running) > MAX_COMBINATIONS:
            raise ValueError(
                f"{len(running)} devices can run in slot {slot}, with more than {MAX_COMBINATIONS:,} combinations of"
                " starts; use more slots, or fewer agents, devices or starts (window)"
            )
        if running:
            constraints.append(_exceeded(slot, running, _supply(slot, slots, supply)))
    return assemble(
        f"smart-grid-{agents}-{devices}-{slots}-{window}-{duration}-{consumption}-{supply}-{seed}",
        {
            home: [Variable(one.variable, Domain(f"Starts{one.variable[1:]}", (one.starts,))) for one in own]
            for home, own in homes.items()
        },
        limited(constraints),
        kind=ProblemKind.DISWCSP,
    )


def _supply(slot: int, slots: int, most: int) -> int:
    """Return the sustainable energy in a slot: it rises to the middle of the day, and falls."""
    return 2 * most * min(slot, slots + 1 - slot) // (slots + 1)


def _exceeded(slot: int, running: list[Device], available: int) -> Constraint:
    """Return the cost of a slot: the consumption that exceeds the available energy."""
    names = tuple(one.variable for one in running)
    needed = total(one.consumed(slot) for one in running)
    excess = Apply("max", (Apply("sub", (needed, Constant(available))), Constant(0)))
    return Constraint(f"Slot{slot}", Function(f"slot{slot}", names, excess), names, names)
