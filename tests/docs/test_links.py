"""What pages name is there: links and their headings, files, and names of the program, so that a rename is noticed."""

from __future__ import annotations

import importlib
import re
import tomllib
from pathlib import Path

from tests.support.architecture_picture import PICTURE, picture
from tests.support.cases import cases
from tests.support.program import ROOT

PAGES = sorted(
    path
    for folder in (ROOT / "docs", ROOT / "benchmarks")
    for path in (*folder.rglob("*.md"), *(ROOT.glob("*.md") if folder.name == "docs" else ()))
    if "examples" not in path.parts
)
GENERATED = re.compile(r"docs/reference/protocols/[a-z-]+\.md")
"""Pages that only the site has: docs/site/hooks.py."""
FILE = re.compile(r"`((?:[a-z_]+/)+[a-z_0-9]+\.(?:py|toml|xsd|md)|(?:robochoc|tests|benchmarks)/[a-z_/]+/)`")


def without_blocks(page: Path) -> str:
    """Return the text of a page without its fenced blocks."""
    return re.sub(r"^ *```.*?^ *```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)


def links_of(page: Path) -> list[str]:
    """Return the targets of a page's links, those in code left out."""
    return re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", without_blocks(page)))


def anchors_of(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as MkDocs and code hosts make them."""
    text = without_blocks(page)
    plain = (re.sub(r"[`*]|\]\([^)]*\)|\[", "", heading) for heading in re.findall(r"^#+ +(.*)$", text, re.MULTILINE))
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", heading.strip().lower())) for heading in plain}


def test_links_lead_to_what_is_there() -> None:
    assert sum(len(links_of(page)) for page in PAGES) > 100
    with cases() as each:
        for page in PAGES:
            with each(page):
                for link in links_of(page):
                    target, _, anchor = link.partition("#")
                    if re.match(r"[a-z]+:", target):
                        continue
                    there = (page.parent / target).resolve() if target else page
                    if GENERATED.fullmatch(str(there.relative_to(ROOT))):
                        continue
                    assert there.exists(), f"{link}: no such file"
                    assert not anchor or anchor in anchors_of(there), f"{link}: no such heading"


def test_files_and_names_of_the_program_are_there() -> None:
    inside = [path for place in ("robochoc", "docs/examples") for path in (ROOT / place).iterdir() if path.is_dir()]
    folders = [ROOT, ROOT / "robochoc", *inside]
    with cases() as each:
        for page in (page for page in PAGES if page.is_relative_to(ROOT / "docs")):
            with each(page):
                text = without_blocks(page)
                for name in FILE.findall(text):
                    assert any((folder / name).exists() for folder in folders), name
                for name in re.findall(r"(?:`|^::: )(robochoc(?:\.\w+)+)", text, re.MULTILINE):
                    assert_importable(name)


def assert_importable(name: str) -> None:
    """Import a module, or get a name of one."""
    module, _, rest = name.rpartition(".")
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        assert hasattr(importlib.import_module(module), rest), name


def test_every_page_of_the_navigation_is_there_and_every_page_is_in_it() -> None:
    named = {*re.findall(r"^ +- (?:\w+: )?([\w/-]+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)}
    only_there = {"reference/protocols/index.md", "reference/results.md", "reference/changes.md"}
    pages = {str(page.relative_to(ROOT / "docs")) for page in PAGES if page.is_relative_to(ROOT / "docs")}
    assert named - only_there == pages


def test_the_packages_of_the_page_are_in_the_order_of_the_layers() -> None:
    """`docs/explanation/architecture.md` against the contract that import-linter checks."""
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"][0]
    layers = [package for layer in contract["layers"] for package in layer.split(" | ") if package != "__main__"]
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text()
    packages = [package.removesuffix(".py") for package in re.findall(r"^\| `([a-z.]+)` \|", page, re.MULTILINE)]
    assert {*packages} == {*layers}
    layer_of = {package: number for number, layer in enumerate(contract["layers"]) for package in layer.split(" | ")}
    assert [layer_of[package] for package in packages] == sorted(layer_of[package] for package in packages)


def test_the_picture_of_the_architecture_shows_the_layers() -> None:
    """`python -m tests.support.architecture_picture` draws it."""
    assert PICTURE.read_text(encoding="utf-8") == picture()


def test_the_readme_is_short_and_shows_where_to_read_on() -> None:
    readme = ROOT / "README.md"
    assert readme.stat().st_size <= 5_000
    assert {f"docs/{place}/index.md" for place in ("tutorials", "guides")} <= {*links_of(readme)}
