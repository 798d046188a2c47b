"""Callbacks for changes."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.app.log import log_error


class Listeners:
    """Callbacks for one kind of change. A call of the object calls all of them."""

    def __init__(self) -> None:
        self._callbacks: list[Callable[[], None]] = []

    def add(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Add a callback. Returns a function that removes it."""
        self._callbacks.append(callback)

        def end() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return end

    def __len__(self) -> int:
        """Return the number of callbacks."""
        return len(self._callbacks)

    def __call__(self) -> None:
        """Call all callbacks that exist when the call starts.

        An error in a callback is written to the error log; the other callbacks are still called.
        """
        for callback in [*self._callbacks]:
            try:
                callback()
            except Exception as fault:  # noqa: BLE001 - written to the error log
                log_error(fault, "listener")
