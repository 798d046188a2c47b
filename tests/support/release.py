"""`make release`: build the files of a release, check them, and try the wheel with each Python. It publishes nothing.

The wheels are built from the source distribution, as pip would do, and everything is built twice: the files must be the
same, byte by byte. Then each Python that is there gets an environment with the pure wheel, and runs the program; and
each extra gets an environment of its own, in which all that needs it is imported.
"""

from __future__ import annotations

import argparse
import hashlib
import itertools
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Iterator, Sequence
from email.parser import HeaderParser
from pathlib import Path

from hatch_build import RELATIVE_LINK
from robochoc import __version__
from tests.support.snippets import blocks_of

ROOT = Path(__file__).parents[2]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
FOR_DEVELOPERS = {"dev", "docs", "fuzz"}
NEEDED = {"robochoc/py.typed", "robochoc/xsd/robot.xsd", "robochoc/sniffer/assets/index.html", "robochoc/app/icon.svg"}
"""Some of what a wheel is not complete without. All must be there that is in git; these are also not to leave git."""
MOST_BYTES = {"sdist": 30_000_000, "wheel": 4_000_000, "compiled": 12_000_000}


class ReleaseError(Exception):
    """Something that must be mended before a release."""


def run(*words: str | Path, folder: Path = ROOT, **environment: str) -> str:
    """Run a program, and return what it prints. Raises `ReleaseError` if it fails."""
    clean = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "ROBOCHOC_PURE"}}
    done = subprocess.run(
        [*map(str, words)], cwd=folder, env={**clean, **environment}, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise ReleaseError(f"{' '.join(map(str, words))}: status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def built(folder: Path, epoch: str) -> list[Path]:
    """Build the source distribution, and from it the pure and the compiled wheel."""
    build = (sys.executable, "-m", "hatchling", "build", "-d", folder)
    run(*build, "-t", "sdist", SOURCE_DATE_EPOCH=epoch)
    (source,) = folder.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as place:
        with tarfile.open(source) as packed:
            packed.extractall(place, filter="data")
        unpacked = Path(place) / source.name.removesuffix(".tar.gz")
        for compile_ in "01":
            run(*build, "-t", "wheel", folder=unpacked, SOURCE_DATE_EPOCH=epoch, ROBOCHOC_COMPILE=compile_)
    return sorted(folder.iterdir())


def digest(file: Path) -> str:
    """Return the SHA-256 of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def package_files(tracked: Sequence[str]) -> set[str]:
    """Return the names that files of the repository have in a wheel, the compiled modules left out."""
    return {name for name in tracked if name.startswith("robochoc/")} | {
        f"robochoc/{name}" for name in tracked if name.startswith("xsd/")
    }


def faults_of(wheel: Path, expected: set[str]) -> Iterator[str]:
    """Yield what is wrong with the contents of a wheel."""
    compiled = not wheel.name.endswith("-none-any.whl")
    with zipfile.ZipFile(wheel) as packed:
        names = {name for name in packed.namelist() if ".dist-info/" not in name}
        information = next(name for name in packed.namelist() if name.endswith(".dist-info/METADATA"))
        metadata = HeaderParser().parsestr(packed.read(information).decode())
    modules = {name for name in names if name.endswith((".so", ".pyd"))}
    yield from (f"{wheel.name}: {name} is missing" for name in sorted((expected | NEEDED) - names))
    yield from (f"{wheel.name}: {name} should not be in it" for name in sorted(names - modules - expected))
    if bool(modules) != compiled:
        yield f"{wheel.name}: {len(modules)} compiled modules"
    if metadata["Version"] != __version__:
        yield f"{wheel.name}: its version is {metadata['Version']}, and not {__version__}"
    for link in re.findall(RELATIVE_LINK, str(metadata.get_payload())):
        yield f"{wheel.name}: its description has a relative link, {link[1]}"


def too_large(files: Sequence[Path]) -> Iterator[str]:
    """Yield the files that have grown beyond what is usual."""
    for file in files:
        kind = "sdist" if file.suffix == ".gz" else "wheel" if file.name.endswith("-none-any.whl") else "compiled"
        if file.stat().st_size > MOST_BYTES[kind]:
            yield f"{file.name}: {file.stat().st_size:,} bytes are more than {MOST_BYTES[kind]:,}"


def pythons() -> list[Path]:
    """Return one interpreter of each version that is on the path, or that pyenv has installed."""
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    found = []
    for version in PYTHONS:
        places = [
            shutil.which(f"python{version}"),
            *map(str, sorted(versions.glob(f"{version}.*/bin/python{version}"))),
        ]
        for place in filter(None, places):
            asked = [place, "-c", "import sys, venv; print('%d.%d' % sys.version_info[:2])"]
            done = subprocess.run(asked, capture_output=True, text=True, check=False)
            if done.stdout.strip() == version:  # pyenv's shims fail for versions that are not chosen
                found.append(Path(place))
                break
    return found


def tried(python: Path, wheel: Path) -> str:
    """Install the wheel in a new environment, and run the program there, far from the sources; return a line."""
    readme = blocks_of((ROOT / "README.md").read_text(encoding="utf-8"))
    example, printed = next((a, b) for a, b in itertools.pairwise(readme) if a.kind == "python")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        run(python, "-m", "venv", folder / "venv")
        bin_ = folder / "venv" / "bin"
        since = time.monotonic()
        run(bin_ / "pip", "install", "--quiet", "--disable-pip-version-check", wheel)
        seconds = time.monotonic() - since
        version = run(bin_ / "robochoc", "--version", folder=folder).strip()
        if not version.startswith(f"robochoc {__version__} "):
            raise ReleaseError(f"{python}: robochoc --version prints {version}")
        (folder / "example.py").write_text(example.text)
        said = run(bin_ / "python", "example.py", folder=folder)
        if printed.kind != "text" or said.strip() != printed.text.strip():
            raise ReleaseError(f"{python}: the example of README.md prints {said!r}")
        notebook = json.loads((ROOT / "docs" / "tutorials" / "model.ipynb").read_text(encoding="utf-8"))
        cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
        (folder / "notebook.py").write_text("\n".join(cells))
        run(bin_ / "python", "notebook.py", folder=folder)
        run(bin_ / "robochoc", "demo", "--no-open", folder=folder)
        if not (folder / "robochoc-demo.html").stat().st_size:
            raise ReleaseError(f"{python}: robochoc demo wrote an empty page")
        size = size_of(folder / "venv")
        packages = run(bin_ / "pip", "list", "--disable-pip-version-check", "--format=freeze").splitlines()
    return (
        f"{version}, Python {python.name.removeprefix('python')}: installed in {seconds:.0f} s ({len(packages)}"
        f" packages, {size / 1e6:.0f} MB); README's example, the notebook and robochoc demo work"
    )


def size_of(folder: Path) -> int:
    """Return the size of all files in a folder, in bytes."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


def tried_extra(python: Path, uv: Path, wheel: Path, extra: str) -> str:
    """Install the wheel with one extra in a new environment, and import all that needs the extra; return a line."""
    with tempfile.TemporaryDirectory() as place:
        venv = Path(place) / "venv"
        inside = venv / "bin" / "python"
        run(uv, "venv", "--quiet", "--python", python, venv)
        run(uv, "pip", "install", "--quiet", "--python", inside, f"robochoc[{extra}] @ {wheel.as_uri()}")
        said = run(inside, "-P", ROOT / "tests" / "support" / "extra_imports.py", extra, folder=Path(place)).strip()
        count = len([*venv.glob("lib/*/site-packages/*.dist-info")])
        return f"extra {extra}: {count} packages, {size_of(venv) / 1e6:.0f} MB; {said}"


def extras() -> list[str]:
    """Return the names of the extras for users."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return sorted({*project["optional-dependencies"]} - FOR_DEVELOPERS)


def release(folder: Path, tools: Path, sbom: Path) -> None:
    """Make all of it in `folder`. Raises `ReleaseError`."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    tracked = run("git", "ls-files").splitlines()
    if run("git", "status", "--porcelain"):
        print("note: the working tree has changes that are not committed")  # noqa: T201 - for make
    epoch = run("git", "log", "-1", "--format=%ct").strip()
    files = built(folder, epoch)
    with tempfile.TemporaryDirectory() as place:
        again = built(Path(place), epoch)
        different = [file.name for file, other in zip(files, again, strict=True) if digest(file) != digest(other)]
    if different:
        raise ReleaseError(f"a second build differs: {', '.join(different)}")
    wheels = [file for file in files if file.suffix == ".whl"]
    faults = [fault for wheel in wheels for fault in faults_of(wheel, package_files(tracked))] + [*too_large(files)]
    if faults:
        raise ReleaseError("\n".join(faults))
    run(tools / "twine", "check", "--strict", *files)
    shutil.copy(sbom, folder / f"robochoc-{__version__}.cdx.json")
    for file in files:
        print(f"{file.stat().st_size:>12,} bytes  {file.name}")  # noqa: T201 - the same
    print("two builds are the same; their contents are complete; twine check has no objection")  # noqa: T201 - the same
    (wheel,) = (file for file in wheels if file.name.endswith("-none-any.whl"))
    for python in pythons():
        print(tried(python, wheel), flush=True)  # noqa: T201 - the same
    for extra in extras():
        print(tried_extra(Path(sys.executable), tools / "uv", wheel, extra), flush=True)  # noqa: T201 - the same
    sums = "".join(f"{digest(file)}  {file.name}\n" for file in sorted(folder.iterdir()))
    (folder / "SHA256SUMS").write_text(sums)
    print(f"{folder}: {len(files) + 2} files; nothing has been published")  # noqa: T201 - the same


def main() -> int:
    """Read the arguments, and release."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/release"), help="the folder to write, anew")
    parser.add_argument("--tools", type=Path, required=True, help="the folder with the programs twine and uv")
    parser.add_argument("--sbom", type=Path, required=True, help="the bill of materials")
    asked = parser.parse_args()
    try:
        release(asked.output.absolute(), asked.tools.absolute(), asked.sbom.absolute())
    except ReleaseError as error:
        print(f"not ready for a release: {error}", file=sys.stderr)  # noqa: T201 - the same
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
