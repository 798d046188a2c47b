"""`make audit`: what pip-audit finds in the locks, with one clear line at the end.

`python tests/support/audit.py PIP_AUDIT LOCK...` ends with 0 when the service knows of no vulnerability, with 1 when it
knows of some, and with 2 when it could not be asked: pip-audit itself takes a package that the service does not answer
about as one to skip.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from typing import Any


def verdict(packages: list[dict[str, Any]]) -> tuple[int, list[str]]:
    """Return the status, and what to print, for the packages of pip-audit's JSON report."""
    found = {
        f"{package['name']} {package['version']}: {known['id']}"
        + (f", mended in {' or '.join(known['fix_versions'])}" if known["fix_versions"] else "")
        for package in packages
        for known in package.get("vulns", ())
    }
    asked = {(package["name"], package["version"]) for package in packages if "skip_reason" not in package}
    unknown = sorted({package["name"] for package in packages if "skip_reason" in package})
    if found:
        return 1, [*sorted(found), f"{len(found)} known vulnerabilities in {len(asked)} packages"]
    if not asked:
        return 2, [f"not audited: the vulnerability service answers about none of the {len(unknown)} packages"]
    if unknown:
        return 2, [f"{len(asked)} packages have no known vulnerability; no answer about {', '.join(unknown)}"]
    return 0, [f"{len(asked)} packages have no known vulnerability"]


def main() -> int:
    """Ask about each lock, and print the outcome."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("program", metavar="PIP_AUDIT", help="the program pip-audit")
    parser.add_argument("locks", nargs="*", metavar="LOCK", help="a file of requirements with hashes")
    asked = parser.parse_args()
    packages = []
    for lock in asked.locks:
        command = [asked.program, "--disable-pip", "--require-hashes", "--progress-spinner=off", "--format=json"]
        done = subprocess.run([*command, "-r", lock], capture_output=True, text=True, check=False)
        try:
            packages += json.loads(done.stdout)["dependencies"]
        except ValueError:
            why = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
            print(f"not audited: pip-audit could not ask its service: {why}")  # noqa: T201 - for make
            return 2
    status, lines = verdict(packages)
    print(*lines, sep="\n")  # noqa: T201 - the same
    return status


if __name__ == "__main__":
    sys.exit(main())
