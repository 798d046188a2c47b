"""What a run asks of the operating system: descriptors enough, and a moment without signals."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager

_STOPPING = {signal.SIGINT, signal.SIGTERM}


def allow_descriptors(needed: int) -> None:
    """Raise the soft limit of open files towards the hard one where the team needs it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < needed:
        limit = needed if hard == resource.RLIM_INFINITY else min(needed, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (limit, hard))


@contextmanager
def signals_held() -> Iterator[None]:
    """Ctrl-C and SIGTERM wait meanwhile: what is half done would be lost."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        # Within, because it may block them and still raise what a signal just before has to say.
        signal.pthread_sigmask(signal.SIG_BLOCK, _STOPPING)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
