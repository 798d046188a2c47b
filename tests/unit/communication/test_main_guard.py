"""A program whose robots' processes import it starts them below `if __name__ == "__main__":`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.support.cases import looped
from tests.support.limits import HANG_S

MODEL = """import robochoc
print("begun", flush=True)
model = robochoc.Model("pair")
one, other = (model.robot(name).variable("x", range(2)) for name in "ab")
model.add(one != other)
"""
SOLVED = 'print(model.solve(runtime="{runtime}").verdict)\n'
NETWORK = SOLVED.format(runtime="network")
FORK_SERVER = 'from robochoc.communication.processes.pool import ProcessPool\nProcessPool("forkserver")\n'
CHECK = """from robochoc.communication.main_guard import require_main_guard
def pool():
    require_main_guard()
    print("passed")
"""


def run(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    """Run a program, whose processes start in the folder of its file."""
    file = folder / "program.py"
    file.write_text(text)
    return subprocess.run([sys.executable, file], capture_output=True, text=True, check=False, timeout=HANG_S)


@looped("text", [MODEL + NETWORK, FORK_SERVER])
def test_without_the_guard_the_program_hears_what_is_missing(text: str, tmp_path: Path) -> None:
    done = run(tmp_path, text)
    assert done.returncode == 1
    message = done.stderr.splitlines()[-1]
    line = len(text.splitlines())
    assert f"UnsupportedError: {tmp_path / 'program.py'}:{line}: each robot's process imports this file" in message
    assert 'below if __name__ == "__main__":' in message
    assert done.stderr.count("Traceback") == 1
    assert done.stdout.count("begun") <= 1


def test_a_guard_before_it_that_guards_something_else_is_none(tmp_path: Path) -> None:
    done = run(tmp_path, CHECK + 'if __name__ == "__main__":\n    print()\npool()\n')
    assert "program.py:7: each robot's process" in done.stderr


@looped(
    "below",
    [
        'if __name__ == "__main__":\n    pool()\n',
        'import sys\nif __name__ != "__main__":\n    sys.exit()\npool()\n',
        'if __name__ != "__main__":\n    raise SystemExit\npool()\n',
        "import threading\nthread = threading.Thread(target=pool)\nthread.start()\nthread.join()\n",
    ],
)
def test_with_a_guard_or_where_nobody_can_see_it_goes_on(below: str, tmp_path: Path) -> None:
    done = run(tmp_path, CHECK + below)
    assert (done.stdout, done.stderr) == ("passed\n", "")


def test_processes_need_no_guard_as_they_are_forked(tmp_path: Path) -> None:
    done = run(tmp_path, MODEL + SOLVED.format(runtime="processes"))
    assert (done.stdout, done.stderr) == ("begun\nsolution\n", "")


def test_of_a_program_without_a_file_nothing_is_imported() -> None:
    words = [sys.executable, "-c", f"{CHECK}\npool()"]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=HANG_S)
    assert (done.stdout, done.stderr) == ("passed\n", "")
