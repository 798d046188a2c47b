"""`make simulate`: runs in virtual time, each decided by its seed.

Exit status 1: a property does not hold. 2: invalid options, or a file that cannot be repeated. 130: Ctrl-C or SIGTERM;
the findings and sums so far are reported.
"""

from __future__ import annotations

import argparse
import json
import secrets
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

from tests.simulation.drawing import drawn_plan
from tests.simulation.minimising import minimised, read, written
from tests.simulation.plan import Plan, changed_options
from tests.simulation.playing import Report, examine


class Tally:
    """The sums over the plans of one worker, and of all workers."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self.verdicts = Counter[str]()
        self.combined = Counter[str]()
        self.findings = Counter[str]()
        self.robot_s = self.cpu_s = 0.0
        self.interrupted = 0

    def add(self, plan: Plan, report: Report) -> None:
        """Add a plan."""
        self.counts.update(seeds=1, runs=report.runs, messages=report.messages)
        self.verdicts[report.verdict if not report.refused else "refused"] += 1
        self.robot_s += report.robot_s
        self.combined[f"runtime {plan.options.runtime}"] += 1
        self.combined[f"protocol {plan.options.protocol}"] += 1
        self.combined.update(f"option {name}" for name in changed_options(plan.options))
        self.combined.update(f"fault {fault.kind}" for fault in plan.faults)
        self.combined["scenario"] += plan.team.dynamic
        self.findings.update({one.kind for one in report.findings})

    def as_json(self) -> str:
        """Return the sums as JSON."""
        return json.dumps({name: dict(v) if isinstance(v, Counter) else v for name, v in vars(self).items()})

    def join(self, text: str) -> None:
        """Add the sums of another worker, as JSON."""
        for name, value in json.loads(text).items():
            own = getattr(self, name)
            own.update(value) if isinstance(own, Counter) else setattr(self, name, own + value)


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(prog="simulate", description="Simulate whole runs with faults in virtual time.")
    parser.add_argument("--seed", type=int, help="the seed of the first run [drawn]")
    parser.add_argument("--count", type=int, help="the number of seeds, one after the other [no limit]")
    parser.add_argument("--seconds", type=float, default=60, help="real time without --count [60]")
    parser.add_argument("--jobs", type=int, default=1, help="processes [1]")
    parser.add_argument("--out", type=Path, default=Path("out/simulate"), help="folder for findings [out/simulate]")
    parser.add_argument("--repeat", type=Path, metavar="FILE", help="repeat the minimised run in FILE")
    parser.add_argument("--inside", type=int, default=None, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.repeat:
        try:
            plan = read(options.repeat)
        except (OSError, ValueError) as error:
            parser.error(str(error))
        return _repeat(plan)
    if options.seed is None:
        options.seed = secrets.randbelow(10**9)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    if options.inside is not None:
        sys.stdout.write(_work(options).as_json() + "\n")
        return 0
    return _all(options)


def _all(options: argparse.Namespace) -> int:
    """Let several processes work, report the sums, and return the exit status."""
    bound = f"COUNT={options.count}" if options.count else f"SECONDS={options.seconds:g}"
    sys.stdout.write(f"seed {options.seed}: make simulate SEED={options.seed} {bound}\n")
    sys.stdout.flush()
    began, total = time.monotonic(), Tally()
    if options.jobs == 1:
        options.inside = 0
        total.join(_work(options).as_json())
    else:
        failed = _join_workers(options, total)
        if failed:
            sys.stdout.write(f"{failed} workers failed\n")
            return 1
    _report(total, time.monotonic() - began)
    return 130 if total.interrupted else int(bool(total.findings))


def _join_workers(options: argparse.Namespace, total: Tally) -> int:
    """Start `jobs` processes and join their sums; return the number of those that failed."""
    command = [sys.executable, "-m", "tests.simulation", "--seed", str(options.seed), "--out", str(options.out)]
    command += ["--jobs", str(options.jobs), "--seconds", f"{options.seconds:g}"]
    command += ["--count", str(options.count)] if options.count else []
    workers = [
        subprocess.Popen([*command, "--inside", str(number)], stdout=subprocess.PIPE, text=True)
        for number in range(options.jobs)
    ]
    failed = 0
    try:
        for worker in workers:
            failed += _join_worker(worker, workers, total)
    finally:
        for worker in workers:
            worker.kill()
            worker.wait()
    return failed


def _join_worker(worker: subprocess.Popen[str], workers: list[subprocess.Popen[str]], total: Tally) -> bool:
    """Join the sums of a process; after Ctrl-C or SIGTERM, all end early. Return whether it has failed."""
    try:
        text, _ = worker.communicate()
    except KeyboardInterrupt:
        for one in workers:
            one.terminate()
        text, _ = worker.communicate()
        total.interrupted = 1
    if text.strip():
        total.join(text.strip().splitlines()[-1])
    return worker.returncode != 0


def _work(options: argparse.Namespace) -> Tally:
    """Examine every `jobs`-th seed, and write the first finding of each kind."""
    tally, began, cpu_s = Tally(), time.monotonic(), time.process_time()
    number = options.inside
    try:
        while number < options.count if options.count else time.monotonic() - began < options.seconds:
            _examine_seed(options.seed + number, options.out, tally)
            number += options.jobs
    except KeyboardInterrupt:
        tally.interrupted = 1
    tally.cpu_s = time.process_time() - cpu_s
    return tally


def _examine_seed(seed: int, out: Path, tally: Tally) -> None:
    """Examine a seed, report its findings, and minimise those that are the first of their kinds."""
    plan = drawn_plan(seed)
    report = examine(plan)
    for finding in report.findings:
        place = ""
        if not tally.findings[finding.kind]:
            smaller = minimised(plan, finding.kind, lambda plan: examine(plan).findings)
            last = [one for one in examine(smaller).findings if one.kind == finding.kind]
            place = f": {written(out, smaller, last[0] if last else finding)}"
        sys.stderr.write(f"seed {plan.seed}: {finding.kind}: {finding.detail[-300:]!a}{place}\n")
    tally.add(plan, report)


def _per_hour(number: float, seconds: float) -> str:
    return f"{number / max(seconds, 0.001) * 3600:,.0f}"


def _report(total: Tally, seconds: float) -> None:
    hours = total.robot_s / 3600
    counts, cpu_s = total.counts, total.cpu_s
    lines = [
        f"{counts['seeds']:,} seeds, {counts['runs']:,} runs, {counts['messages']:,} messages",
        f"{seconds:,.0f} s, {cpu_s:,.0f} s of CPU time",
        f"{hours:,.0f} simulated robot-hours: {_per_hour(hours, seconds)} an hour",
        f"an hour of CPU time: {_per_hour(hours, cpu_s)} robot-hours, {_per_hour(counts['runs'], cpu_s)} runs",
        "verdicts: " + ", ".join(f"{name} {n:,}" for name, n in total.verdicts.most_common()),
        "combined: " + ", ".join(f"{name} {n:,}" for name, n in sorted(total.combined.items())),
        "findings: " + (", ".join(f"{name} {n:,}" for name, n in total.findings.most_common()) or "none"),
    ]
    sys.stdout.write("\n".join(lines) + "\n")


def _repeat(plan: Plan) -> int:
    """Play `plan`. Return 1 if it has a finding."""
    report = examine(plan)
    for finding in report.findings:
        sys.stdout.write(f"{finding.kind}: {finding.detail}\n")
    if not report.findings:
        sys.stdout.write(f"no finding ({report.refused or report.verdict})\n")
    return int(bool(report.findings))


if __name__ == "__main__":
    sys.exit(main())
