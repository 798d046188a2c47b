"""Packages whose public names are imported on first use, so that commands start quickly."""

from __future__ import annotations

from collections.abc import Callable, Mapping


def lazy_names(package: str, modules: Mapping[str, str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package.

    Args:
        package: The name of the package.
        modules: The module that defines each name.
    """

    def get(name: str) -> object:
        if name not in modules:
            from robochoc.system.suggestions import did_you_mean  # noqa: PLC0415 - start-up: only mistakes need it

            hint = "" if name.startswith("_") else did_you_mean(name, modules)
            raise AttributeError(f"module {package!r} has no attribute {name!r}{hint and '; '}{hint}")
        from importlib import import_module  # noqa: PLC0415 - start-up

        return getattr(import_module(modules[name]), name)

    return get, lambda: sorted(modules)
