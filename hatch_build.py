"""Puts compiled modules into the wheel, where there is a C compiler, and README.md into the metadata, as PyPI shows it.

The reasons are in docs/explanation/design/development.md, "Compiled core".

`pyproject.toml` lists the modules. Their sources are in the wheel as well. Without a compiler, or where mypyc fails,
the wheel has the sources alone. An editable install has always these alone, and needs no time for it.

ROBOCHOC_COMPILE=1: a build that cannot compile fails. ROBOCHOC_COMPILE=0: nothing is compiled.
"""

from __future__ import annotations

import ast
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

NEEDED = ["msgspec>=0.18", "mypy[mypyc]>=1.13"]
"""mypyc sees the types of what is imported: without msgspec it would know nothing of messages."""
NEXT = "A C compiler and Python's headers are needed. Without ROBOCHOC_COMPILE=1, a build without them is plain Python."
KERNELS = "robochoc.communication.arrays._kernels"
KERNELS_FLAGS = ["-O3", "-fwrapv", "-ffp-contract=off"]
"""The flags of C compilers other than Microsoft's: unused sums may overflow, and floats are rounded as in numpy."""
MYPY = ["--config-file=", "--follow-imports=silent", "--ignore-missing-imports"]

ONLY_REPOSITORY = re.compile(r"<!-- repository -->.*?<!-- end -->\n*", re.DOTALL)
ONLY_PYPI = re.compile(r"<!-- PyPI: (.*?) -->")
STRUCTS = "_structs"
"""The end of the names of modules with structs that the build creates."""
RELATIVE_LINK = r"\[([^\]]*)\]\((?![a-z]+:|#)([^)\s]+)\)"


class LongDescription(MetadataHookInterface):
    """hatchling asks it for the fields of the metadata that `pyproject.toml` declares as dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the long description."""
        readme = Path(self.root, "README.md").read_text(encoding="utf-8")
        repository = metadata.get("urls", {}).get("Repository", "")
        text = long_description(readme, repository, metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


def long_description(readme: str, repository: str, version: str) -> str:
    """Return README.md as PyPI shows it, where relative links lead nowhere.

    Links and pictures lead to the version's tag in the repository. Without a repository, pictures and references in
    parentheses are removed, and other links are replaced by their text.
    """
    text = ONLY_PYPI.sub(r"\1", ONLY_REPOSITORY.sub("", readme))
    if not repository:
        text = re.sub(rf" \({RELATIVE_LINK}\)|!{RELATIVE_LINK}\n*", "", text)
        return re.sub(RELATIVE_LINK, r"\1", text)

    def absolute(found: re.Match[str]) -> str:
        view = "raw" if found[1] else "blob"
        return f"{found[1]}[{found[2]}]({repository.rstrip('/')}/{view}/v{version}/{found[3]})"

    return re.sub(rf"(!?){RELATIVE_LINK}", absolute, text)


class CompiledCore(BuildHookInterface):  # type: ignore[type-arg]
    """hatchling asks it for what it needs, and lets it work before the wheel is packed."""

    def dependencies(self) -> list[str]:
        """Return what a build needs besides hatchling: nothing where nothing can be compiled."""
        return NEEDED if may_compile() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and add what has been made to the wheel. Raises `RuntimeError` where it must not fail, and does."""
        if version == "editable" or not may_compile():
            return
        self._folder = Path(tempfile.mkdtemp(prefix="robochoc-compiled-"))
        failure = _compiled(Path(self.root), self._folder, self.config["modules"])
        if failure:
            if _asked():
                raise RuntimeError(f"mypyc or the C compiler has failed:\n{failure}\n{NEXT}")
            return
        places = [f"{folder}*.{suffix}" for folder in ("", "robochoc/**/") for suffix in ("so", "pyd")]
        places.append(f"robochoc/**/*{STRUCTS}.py")
        made = [path for place in places for path in self._folder.glob(place)]
        build_data["force_include"].update({str(path): str(path.relative_to(self._folder)) for path in made})
        build_data.update(pure_python=False, infer_tag=True)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:  # noqa: ARG002 - hatchling's
        """Remove what has been packed."""
        shutil.rmtree(getattr(self, "_folder", ""), ignore_errors=True)


def _asked() -> bool:
    return os.environ.get("ROBOCHOC_COMPILE") == "1"


def may_compile() -> bool:
    """Return whether to compile: it is asked for, or there is a compiler with Python's headers."""
    if os.environ.get("ROBOCHOC_COMPILE") in {"0", "1"}:
        return _asked()
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")[0]
    headers = Path(sysconfig.get_path("include"), "Python.h")
    return shutil.which(compiler) is not None and headers.exists()


def _compiled(root: Path, folder: Path, modules: list[str]) -> str:
    """Compile the modules in a copy of the package; return what went wrong, or nothing."""
    shutil.copytree(
        root / "robochoc", folder / "robochoc", ignore=shutil.ignore_patterns("__pycache__", "*.so", "*.pyd")
    )
    for module in modules:
        _move_structs(folder.joinpath(*module.split(".")).with_suffix(".py"), module)
    words = [sys.executable, __file__, *modules]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603 - ourselves
    return "" if done.returncode == 0 else done.stdout + done.stderr


def _move_structs(path: Path, module: str) -> None:
    """Move the structs of msgspec in a module (messages, settings) into a module that is not compiled.

    mypyc cannot create them. The names at the top level that they use are moved, too. Lines keep their numbers.
    """
    text = path.read_text(encoding="utf-8")
    kept, moved = split_structs(text, f"{module}{STRUCTS}")
    if moved:
        path.write_text(kept, encoding="utf-8")
        path.with_name(f"{path.stem}{STRUCTS}.py").write_text(moved, encoding="utf-8")


def split_structs(text: str, name: str) -> tuple[str, str]:
    """Return the source `text` without its structs, which it imports from the module `name`, and that module's source.

    A class is a struct if its statement has keywords, such as `frozen=True`. The second text is empty without structs.
    """
    body = ast.parse(text).body
    defined = {name: one for one in body for name in _defined(one)}
    structs = [one for one in body if isinstance(one, ast.ClassDef) and one.keywords]
    moved: dict[str, ast.stmt] = {}
    waiting = [one.name for one in structs]
    while waiting:
        one = moved[waiting[-1]] = defined[waiting[-1]]
        used = {node.id for node in ast.walk(one) if isinstance(node, ast.Name)}
        waiting = [*waiting[:-1], *(name for name in used if name in defined and name not in moved)]
    lines = text.splitlines()
    imports = [one for one in body if isinstance(one, ast.Import | ast.ImportFrom | ast.If)]
    parts = [*imports, *sorted({id(one): one for one in moved.values()}.values(), key=lambda one: one.lineno)]
    found = ["\n".join(lines[_first_line(one) - 1 : one.end_lineno]) for one in parts]
    for one in parts[len(imports) :]:
        for number in range(_first_line(one) - 1, one.end_lineno or 0):
            lines[number] = ""
    if not structs:
        return text, ""
    last = imports[-1].end_lineno or 0
    lines[last] = f"from {name} import {', '.join(sorted(moved))}"
    return "\n".join(lines) + "\n", "\n".join(found) + "\n"


def _defined(one: ast.stmt) -> list[str]:
    """Return the names that a statement at the top level defines."""
    if isinstance(one, ast.ClassDef | ast.FunctionDef):
        return [one.name]
    targets = one.targets if isinstance(one, ast.Assign) else [one.target] if isinstance(one, ast.AnnAssign) else []
    return [target.id for target in targets if isinstance(target, ast.Name)]


def _first_line(one: ast.stmt) -> int:
    decorators = one.decorator_list if isinstance(one, ast.ClassDef | ast.FunctionDef) else []
    return min([one.lineno, *(decorator.lineno for decorator in decorators)])


def kernels_library(root: Path, folder: Path) -> Path:
    """Compile the kernels as a library in `folder`, for tests and benchmarks of a checkout; return the library."""
    library = folder / "kernels.so"
    compiler = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    words = [*compiler, *KERNELS_FLAGS, "-Wall", "-shared", "-fPIC", f"-I{sysconfig.get_path('include')}"]
    source = root / f"{KERNELS.replace('.', '/')}.c"
    subprocess.run([*words, "-o", str(library), str(source)], check=True)  # noqa: S603 - the compiler
    return library


def _compile_here(modules: list[str]) -> None:
    """Compile the modules and the kernels in this folder, each beside its source. An error ends the process."""
    from mypyc.build import mypycify  # noqa: PLC0415 - where nothing is compiled it need not be there
    from setuptools import Distribution, Extension  # noqa: PLC0415 - the same

    files = [f"{module.replace('.', '/')}.py" for module in modules]
    extensions = mypycify([*MYPY, *files], group_name="robochoc", opt_level="2", debug_level="0")
    flags = KERNELS_FLAGS if sys.platform != "win32" else []
    extensions.append(Extension(KERNELS, [f"{KERNELS.replace('.', '/')}.c"], extra_compile_args=flags))
    command = Distribution({"ext_modules": extensions}).get_command_obj("build_ext")
    command.inplace = True
    command.ensure_finalized()
    command.run()


if __name__ == "__main__":
    _compile_here(sys.argv[1:])
