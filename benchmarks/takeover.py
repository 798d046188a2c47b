"""Kills, stops and cuts off masters and robots at any moment: each trial ends in one decision, or says why not.

Three robots know a master and two standby masters. Each machine is a network namespace; all are joined by a bridge. In
each trial, a seed chooses one or two faults: a process is killed or stopped (and perhaps continues), or a machine is
cut off (and perhaps connected again). The masters use a random protocol with different seeds, so that two decisions
would probably differ. Rows are appended to out/takeover.jsonl; a trial that is in this file is not repeated.

    python benchmarks/takeover.py --trials 1000 --jobs 2
    python benchmarks/takeover.py --table

It needs Linux, root and iproute2.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import random
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import robochoc.run.networked.master_run  # noqa: F401 - imported before the forks
from robochoc.cli.group import cli
from robochoc.communication.network.masters import HEARTBEAT_S

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "takeover.jsonl"
FILES = ROOT / "docs" / "examples" / "scouts"
MASTERS, ROBOTS = ("MASTER", "B", "C"), ("Scout", "Relay", "Base")
MACHINES = (*MASTERS, *ROBOTS)
PORT = 7447
LATEST_S = 4.0
"""The latest time of a fault, in seconds: after the start of the robots, or, in two of three trials, of the search."""
GATHER_S, PATIENCE_S, ROBOT_PATIENCE_S = 20, 3, 12
START_S, HANG_S, STEP_S = 60, 150, 0.05
SEARCH = ("--protocol", "dsa", "--set", "cycles=500")
_NEWNET = 0x40000000


class Fault(NamedTuple):
    """At `at_s`, `kind` happens to `machine`; it is undone after `for_s` seconds (None: never)."""

    at_s: float
    kind: str
    machine: str
    for_s: float | None


def faults_of(seed: int) -> list[Fault]:
    """Return the faults of a trial."""
    chance = random.Random(seed)
    found = []
    for _ in range(chance.choice((1, 1, 2))):
        kind = chance.choice(("kill", "stop", "cut"))
        machine = chance.choice((*MASTERS[:1] * 4, *MASTERS, *ROBOTS))
        for_s = None if kind == "kill" or chance.random() < 0.5 else chance.uniform(1, 15)
        found.append(Fault(round(chance.uniform(0, LATEST_S), 3), kind, machine, for_s))
    return sorted(found)


def is_in_search(seed: int) -> bool:
    """Return whether the time of a trial begins with the search."""
    return seed % 3 != 0


def ip(*words: str) -> None:
    """Run `ip`."""
    subprocess.run(["/usr/sbin/ip", *words], check=True, capture_output=True)


class Site:
    """The machines of one job: namespaces `rcJOB-NAME`, joined by a bridge, and the folders of the machines."""

    def __init__(self, job: int, folder: Path) -> None:
        self.folder = folder
        self._prefix = f"rc{os.getpid()}j{job}"
        self._net = f"10.{80 + job}.0."

    def namespace(self, machine: str) -> str:
        """Return the name of the namespace of a machine."""
        return f"{self._prefix}{machine}"

    def address(self, machine: str) -> str:
        """Return the IP address of a machine."""
        return f"{self._net}{1 + MACHINES.index(machine)}"

    @contextmanager
    def open(self) -> Iterator[None]:
        """Create the namespaces, and remove them at the end."""
        hub = self.namespace("hub")
        try:
            ip("netns", "add", hub)
            ip("-n", hub, "link", "add", "bridge", "type", "bridge")
            ip("-n", hub, "link", "set", "bridge", "up")
            for place, machine in enumerate(MACHINES):
                there = self.namespace(machine)
                ip("netns", "add", there)
                ip("-n", there, "link", "set", "lo", "up")
                ip("-n", hub, "link", "add", f"p{place}", "type", "veth", "peer", "name", "eth", "netns", there)
                ip("-n", hub, "link", "set", f"p{place}", "master", "bridge", "up")
                ip("-n", there, "addr", "add", f"{self.address(machine)}/24", "dev", "eth")
                ip("-n", there, "link", "set", "eth", "up")
            yield
        finally:
            for machine in ("hub", *MACHINES):
                command = ["/usr/sbin/ip", "netns", "del", self.namespace(machine)]
                subprocess.run(command, check=False, capture_output=True)

    def cut(self, machine: str, state: str) -> None:
        """Cut a machine off (`down`), or connect it again (`up`)."""
        ip("-n", self.namespace("hub"), "link", "set", f"p{MACHINES.index(machine)}", state)

    def start(self, machine: str, words: Sequence[str], name: str) -> int:
        """Start `robochoc` on a machine, as a fork of this process; its output is written to files called `name`."""
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        files = [os.open(self.folder / f"{name}.{machine}.{ending}", flags) for ending in ("out", "err")]
        (self.folder / machine).mkdir(exist_ok=True)
        pid = os.fork()
        if pid:
            for descriptor in files:
                os.close(descriptor)
            return pid
        status = 1
        try:
            os.setsid()
            for descriptor, file in zip((1, 2), files, strict=True):
                os.dup2(file, descriptor)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            with Path(f"/run/netns/{self.namespace(machine)}").open() as there:
                if ctypes.CDLL(None, use_errno=True).setns(there.fileno(), _NEWNET):
                    raise OSError(ctypes.get_errno(), "setns")
            os.environ["XDG_DATA_HOME"] = str(self.folder / machine)
            try:
                cli.main(list(words), prog_name="robochoc")
            except SystemExit as end:
                status = end.code if isinstance(end.code, int) else 1
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(status)

    def place(self, machine: str) -> str:
        """Return the address of a master."""
        return f"{self.address(machine)}:{PORT}"

    def run(self, *words: str) -> str:
        """Return the output of a command outside the namespaces."""
        command = [sys.executable, "-m", "robochoc", *words]
        return subprocess.run(command, check=True, capture_output=True, text=True, cwd=ROOT).stdout

    def enrol(self) -> dict[str, str]:
        """Create the Authority. Return the tokens of all machines that need one."""
        authority = str(self.folder / "authority")
        self.run("authority", "init", "--authority", authority)
        tokens = {}
        for machine in MACHINES[1:]:
            role = ("--role", "master", "--host", self.address(machine)) if machine in MASTERS else ()
            line = self.run("authority", "enrol", machine, *role, "--authority", authority)
            tokens[machine] = line.split()[1]
        return tokens


def start_masters(site: Site, seed: int, tokens: Mapping[str, str], name: str) -> dict[str, int]:
    """Start the masters, and wait until they are ready. Return their process identifiers."""
    pids = {}
    for rank, machine in enumerate(MASTERS):
        leaders = ",".join(map(site.place, MASTERS[:rank]))
        who = ["--standby", leaders, "--as", machine] if rank else ["--authority", str(site.folder / "authority")]
        if machine in tokens:
            who += ["--token", tokens[machine]]
        options = ["--robots", "3", *SEARCH, "--seed", str(3 * seed + rank), "--json", "--gather", str(GATHER_S)]
        limits = ["--patience", str(PATIENCE_S), "--on-loss", "withdraw"]
        pids[machine] = site.start(machine, ["master", "--listen", site.place(machine), *who, *options, *limits], name)
        ready, errors = "standing by" if rank else "listening at", site.folder / f"{name}.{machine}.err"
        until = time.monotonic() + START_S
        while ready not in errors.read_text() and time.monotonic() < until:
            time.sleep(STEP_S)
    time.sleep(3 * HEARTBEAT_S)  # the standby masters receive an answer
    return pids


def start_robots(site: Site, tokens: Mapping[str, str], name: str) -> dict[str, int]:
    """Start the robots. Return their process identifiers."""
    masters = ",".join(map(site.place, MASTERS))
    limits = ["--patience", str(ROBOT_PATIENCE_S), "--json"]
    return {
        machine: site.start(
            machine,
            ["robot", str(FILES / f"{machine}.xml"), "--master", masters, *limits]
            + (["--token", tokens[machine]] if machine in tokens else []),
            name,
        )
        for machine in ROBOTS
    }


class Play:
    """The course of a trial: its processes, and the faults that are due."""

    def __init__(self, site: Site, pids: Mapping[str, int], faults: Sequence[Fault]) -> None:
        self.statuses: dict[str, int] = {}
        self.alive = dict(pids)
        self._site = site
        self._due = [(fault.at_s, fault, True) for fault in faults]
        self._due += [(fault.at_s + fault.for_s, fault, False) for fault in faults if fault.for_s is not None]
        self._due.sort(key=lambda one: one[0])
        self._stopped = {fault.machine for fault in faults if fault.kind == "stop" and fault.for_s is None}

    @property
    def is_over(self) -> bool:
        """True if all processes have ended, except for those that are stopped for good."""
        return self.alive.keys() <= self._stopped and not self._due

    @property
    def hung(self) -> list[str]:
        """The machines whose processes have not ended, and are not stopped."""
        return sorted(self.alive.keys() - self._stopped)

    def step(self, now: float) -> None:
        """Let the faults happen that are due, and note which processes have ended."""
        while self._due and self._due[0][0] <= now:
            self._strike(*self._due.pop(0)[1:])
        for machine, pid in list(self.alive.items()):
            found, status = os.waitpid(pid, os.WNOHANG)
            if found:
                self.statuses[machine] = os.waitstatus_to_exitcode(status)
                del self.alive[machine]

    def _strike(self, fault: Fault, is_start: bool) -> None:  # noqa: FBT001 - from the list of what is due
        if fault.kind == "cut":
            self._site.cut(fault.machine, "down" if is_start else "up")
        elif fault.machine in self.alive:
            number = {"kill": signal.SIGKILL, "stop": signal.SIGSTOP}[fault.kind] if is_start else signal.SIGCONT
            os.kill(self.alive[fault.machine], number)

    def end(self) -> None:
        """Kill the remaining processes."""
        for pid in self.alive.values():
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)


def trial(site: Site, seed: int, tokens: Mapping[str, str], faults: Sequence[Fault]) -> dict[str, Any]:
    """Play a trial, and return its row."""
    name = f"t{seed}"
    for machine in MACHINES:
        site.cut(machine, "up")
    play = Play(site, {**start_masters(site, seed, tokens, name), **start_robots(site, tokens, name)}, faults)
    until, log = time.monotonic() + START_S, site.folder / f"{name}.{MASTERS[0]}.err"
    while is_in_search(seed) and "leads in term" not in log.read_text() and time.monotonic() < until:
        time.sleep(STEP_S / 5)
    decided_s, began = None, time.monotonic()
    while not play.is_over and (now := time.monotonic() - began) < HANG_S:
        play.step(now)
        if decided_s is None and any((site.folder / f"{name}.{master}.out").stat().st_size for master in MASTERS):
            decided_s = now
        time.sleep(STEP_S)
    hung = play.hung
    play.end()
    row = {"seed": seed, "faults": faults, "statuses": play.statuses, "hung": hung, "decided_s": decided_s}
    return row | outcome(site, name)


def outcome(site: Site, name: str) -> dict[str, Any]:
    """Return the decisions of masters and robots, whether they differ, and the reasons of those who did not decide."""
    decisions: dict[str, Any] = {}
    values: dict[str, int] = {}
    why: dict[str, str] = {}
    for machine in MACHINES:
        out, err = ((site.folder / f"{name}.{machine}.{ending}") for ending in ("out", "err"))
        if text := out.read_text():
            result = json.loads(text)
            if machine in MASTERS:
                decision = {"term": result.get("term"), "lost": result.get("lost", [])}
                decisions[machine] = {**decision, "values": result["assignment"]}
            else:
                values |= result["assignment"]
        elif lines := err.read_text().splitlines():
            why[machine] = lines[-1][:200]
        if "Traceback" in err.read_text():
            why[machine] = "Traceback"
        out.unlink()
        err.unlink()
    found = [one["values"] for one in decisions.values()]
    shown = [*found, values]
    split = any(a[v] != b[v] for a in shown for b in shown for v in a.keys() & b.keys())
    return {"decisions": decisions, "robots": values, "split": split, "why": why}


def play_all(number: int, seeds: Sequence[int]) -> None:
    """Play the trials of one job."""
    with tempfile.TemporaryDirectory(prefix="takeover") as folder:
        site = Site(number, Path(folder))
        with site.open():
            tokens = site.enrol()
            first = trial(site, 0, tokens, [])  # all enrol
            if first["statuses"] != dict.fromkeys(MACHINES, 0):
                raise SystemExit(f"the first run failed: {first}")
            for seed in seeds:
                row = trial(site, seed, {}, faults_of(seed))
                with OUT.open("a") as file:
                    file.write(json.dumps(row) + "\n")


def rows() -> list[dict[str, Any]]:
    """Return the rows of all trials so far."""
    return [json.loads(line) for line in OUT.read_text().splitlines()] if OUT.exists() else []


def seconds_of(row: Mapping[str, Any]) -> float | None:
    """Return the time from the last fault to the decision, if the leading master had a fault before; else None."""
    at_s = row["faults"][-1][0]
    is_takeover = any(fault[2] == MASTERS[0] for fault in row["faults"])
    return row["decided_s"] - at_s if is_takeover and row["decided_s"] is not None and row["decided_s"] > at_s else None


def table() -> str:
    """Return the table in docs/guides/several-machines.md."""
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows():
        groups.setdefault(" + ".join(sorted({fault[1] for fault in row["faults"]})), []).append(row)
    heads = ("trials", "faults", "decision", "refused, with a reason", "hangs", "split decisions", "median", "99 %")
    lines = ["| kinds | " + " | ".join(heads) + " |", "| --- |" + " ---: |" * len(heads)]
    for kinds, found in [*sorted(groups.items()), ("**all**", rows())]:
        times = sorted(filter(None, map(seconds_of, found)))
        decided = sum(bool(row["decisions"]) for row in found)
        split, hung = sum(row["split"] for row in found), sum(bool(row["hung"]) for row in found)
        middle = f"{statistics.median(times):.1f} s" if times else "-"
        late = f"{times[int(0.99 * (len(times) - 1))]:.1f} s" if times else "-"
        number = sum(len(row["faults"]) for row in found)
        cells = (kinds, len(found), number, decided, len(found) - decided, hung, split, middle, late)
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    """Play the trials that are missing, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1000)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    if given.table:
        print(table())
        why = Counter(text for row in rows() if not row["decisions"] for text in row["why"].values())
        print(*why.most_common(10), sep="\n", file=sys.stderr)
        return
    OUT.parent.mkdir(exist_ok=True)
    known = {row["seed"] for row in rows()}
    seeds = [seed for seed in range(given.first, given.first + given.trials) if seed not in known]
    children = []
    for number in range(given.jobs):
        pid = os.fork()
        if pid == 0:
            play_all(number, seeds[number :: given.jobs])
            os._exit(0)
        children.append(pid)
    for pid in children:
        os.waitpid(pid, 0)


if __name__ == "__main__":
    main()
