"""Who is told when something changes."""

from __future__ import annotations

from collections.abc import Callable

from robochoc.app.log import noted


class Listeners:
    """Callbacks that are called when there is news. Call it to tell all of them."""

    def __init__(self) -> None:
        self._callbacks: list[Callable[[], None]] = []

    def add(self, callback: Callable[[], None]) -> Callable[[], None]:
        """Call `callback` from now on; return what ends that."""
        self._callbacks.append(callback)

        def end() -> None:
            if callback in self._callbacks:
                self._callbacks.remove(callback)

        return end

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._callbacks)

    def __call__(self) -> None:
        """Tell all. Who is added or removed meanwhile is told the next time, or once more.

        One that fails keeps nobody else from being told; the file of errors has what is known of it.
        """
        for callback in [*self._callbacks]:
            try:
                callback()
            except Exception as fault:  # noqa: BLE001 - kept in the file of errors
                noted(fault, "listener")
