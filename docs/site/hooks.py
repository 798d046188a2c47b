"""Pages of the site that are generated, and links that leave the folder of the documentation.

MkDocs calls the functions whose names begin with `on_` (https://www.mkdocs.org/user-guide/configuration/#hooks). A page
per protocol is made from the protocol's class and docstring, so a protocol that is installed has one; each example
team gets a page with its files; the results of the benchmarks and the list of changes are taken as they are.
"""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import click
from msgspec import Struct

from robochoc.cli.group import cli
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.settings import Settings
from robochoc.run.registry import installed_protocols
from robochoc.system.compiled_core import docstring

if TYPE_CHECKING:
    from mkdocs.config.defaults import MkDocsConfig
    from mkdocs.structure.files import Files
    from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
LANGUAGES = {".xml": "xml", ".py": "python", ".toml": "toml"}
PROTOCOLS = "reference/protocols/index.md"
STUDIES = {
    f"benchmarks/results/{page.name}": f"reference/results/{page.name}"
    for page in sorted((ROOT / "benchmarks" / "results").glob("*.md"))
}
"""The pages of our own studies, and those of the site."""
MOVED = {"benchmarks/RESULTS.md": "reference/results.md", "CHANGELOG.md": "reference/changes.md", **STUDIES}
"""Files of the repository that are pages of the site, under these names."""


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of protocols, examples and studies into the navigation, beside their lists.

    A page of one version, which mike builds, has a selector of versions. It requires a server.
    """
    if "MIKE_DOCS_VERSION" in os.environ:
        config.extra["version"] = {"provider": "mike", "default": "latest", "alias": True}
    names = sorted(Path(name).stem for name in protocol_pages() if name != PROTOCOLS)
    protocols = [{name: f"reference/protocols/{name}.md"} for name in names]
    for section in config.nav or []:
        for pages in section.values():
            if isinstance(pages, list) and PROTOCOLS in pages:
                pages[pages.index(PROTOCOLS)] = {"Protocols": [PROTOCOLS, *protocols]}
                pages.append({"Examples": [*example_pages()]})
                pages.append({"Studies": [*STUDIES.values()]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and the files of the studies."""
    from mkdocs.structure.files import File  # noqa: PLC0415 - this module is also read where MkDocs is not installed

    pages = {**protocol_pages(), **example_pages()}
    pages |= {name: with_links((ROOT / path).read_text(), path, name) for path, name in MOVED.items()}
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    for study in (ROOT / "benchmarks" / "studies").glob("*.toml"):
        files.append(File.generated(config, f"reference/studies/{study.name}", abs_src_path=str(study)))
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the page's text, its links to files outside of the site's source changed to their pages."""
    del files
    if page.is_homepage and config.site_url:  # the selector of versions looks for this address in the sitemap
        page.canonical_url = f"{config.site_url.rstrip('/')}/"
    markdown = markdown.replace("<!-- commands -->", "\n".join(command_reference(cli, "robochoc", 2)))
    return with_links(markdown, f"docs/{page.file.src_uri}", page.file.src_uri)


def on_page_content(html: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Return the page's HTML, in which no line breaks within an option, and no empty cell is a heading."""
    del page, config, files
    html = re.sub(r"<th[^>]*></th>", "<td></td>", html)
    html = re.sub(r"<code>(--?[a-z][^<\n]{0,28})</code>", r'<code class="option">\1</code>', html)
    return re.sub(r"<code>[^<\n]+ --?[a-z][^<\n]*</code>", with_whole_options, html)


def with_whole_options(command: re.Match[str]) -> str:
    """Return a command within a sentence, in which no line breaks within an option."""
    return re.sub(r" (--?[a-z][a-z-]*)", r' <span class="option">\1</span>', command[0])


def on_post_page(html: str, *, page: Page, config: MkDocsConfig) -> str:
    """Return the page with the names that the theme leaves out."""
    del page, config
    return with_names(html)


def on_post_template(output_content: str, *, template_name: str, config: MkDocsConfig) -> str:
    """Return a file made from a template alone; of the page for missing addresses, with names as in other pages."""
    del config
    return with_names(output_content) if template_name == "404.html" else output_content


def with_names(html: str) -> str:
    """Return a page with names of the search and of each part of the navigation, for screen readers."""
    names = dict(
        re.findall(r'<label class="md-nav__title" for="(__nav_\w+)">\s*<span[^>]*></span>([^<]*)</label>', html)
    )
    html = re.sub(
        r'(id="(__nav_\w+)_label" tabindex="\d?">)(?=\s*<span class="md-nav__icon)',
        lambda found: f'{found[1]}<span class="spoken">{names[found[2]].strip()}</span>',
        html,
    )
    # Lists of headings are no landmarks: their names would be those of other parts.
    html = re.sub(r'<nav class="md-nav" aria-label="[^"]*">', '<nav class="md-nav" role="none">', html)
    html = html.replace('class="md-search__options" aria-label="Search"', 'class="md-search__options" role="none"', 1)
    return html.replace('class="md-search"', 'class="md-search" aria-label="Search"', 1)


def with_links(text: str, path: str, name: str) -> str:
    """Return `text`, the file `path` of the repository, with links as they have to be on the page `name`."""

    def link(found: re.Match[str]) -> str:
        target, hash_, anchor = found["target"].partition("#")
        if not target or ":" in target:
            return found[0]
        to = page_of(os.path.normpath(os.path.join(os.path.dirname(path), target)))  # noqa: PTH118, PTH120 - not files
        return f"]({os.path.relpath(to, os.path.dirname(name) or '.')}{hash_}{anchor})"  # noqa: PTH120

    return re.sub(r"\]\((?P<target>[^)\s]+)\)", link, text)


def page_of(path: str) -> str:
    """Return the name of the site's page for a file or folder of the repository."""
    if path in MOVED:
        return MOVED[path]
    if path.startswith("benchmarks/studies/"):
        return path.replace("benchmarks", "reference", 1)
    if re.fullmatch(r"docs/examples/[a-z]+", path):
        return f"{path.removeprefix('docs/')}/index.md"
    return path.removeprefix("docs/")


# Protocols


def protocol_pages() -> dict[str, str]:
    """Return the text of the protocols' pages and of their list, by the pages' names."""
    protocols = {offer.name: offer.protocol for offer in installed_protocols() if offer.protocol}
    first: dict[type[Struct], str] = {}  # a page, and an anchor, for each message, though several protocols send it
    for name, kind in protocols.items():
        for item in structs(kind):
            first.setdefault(item, name)
    pages = {f"reference/protocols/{name}.md": protocol_page(name, kind, first) for name, kind in protocols.items()}
    rows = [
        f"| [`{name}`]({name}.md) | {title(kind)} | {purpose(kind)} | {kind.traits.use_when} |"
        for name, kind in protocols.items()
    ]
    listing = [
        "# Protocols",
        "",
        "One page per protocol, from its docstring. See also [which protocol when](../../guides/which-protocol.md).",
        "",
        "| name | | for | use when |",
        "| --- | --- | --- | --- |",
        *rows,
    ]
    return {**pages, PROTOCOLS: "\n".join(listing)}


def protocol_page(name: str, kind: type[Protocol], first: Mapping[type[Struct], str]) -> str:
    """Return the page of one protocol: its traits, its docstring, its settings and its messages.

    What stands on the page of another protocol `first` is not shown again: there is a link.
    """
    traits = kind.traits
    facts = {
        "name": f"`--protocol {name}`",
        "for": purpose(kind),
        "use when": traits.use_when,
        "complete": "yes" if traits.complete else "no: it ends with a good answer, and proves nothing",
        "constraints": ", ".join(["n-ary" if traits.n_ary else "binary", *["PKC"] * traits.partially_known]),
        "problems that change": "goes on with what still holds" if traits.dynamic else "begins anew",
        "hides": traits.privacy or "nothing",
        "paper": traits.paper,
    }
    table = "\n".join(f"| {key} | {value} |" for key, value in facts.items())
    listed = [struct_block(item) if first[item] == name else struct_link(item, first[item]) for item in structs(kind)]
    whole = "{members: false, show_root_heading: false, show_root_toc_entry: false}"
    parts = [
        f"# {title(kind)}\n\n| | |\n| --- | --- |\n{table}\n",
        f"::: {kind.__module__}\n    options: {whole}\n",
        *(["## Messages and settings\n", *listed] if listed else []),
    ]
    return "\n".join(parts)


def struct_block(item: type[Struct]) -> str:
    """Return the block for mkdocstrings that shows a message or settings, with the fields."""
    fields = ", ".join(item.__struct_fields__)
    options = f"{{heading_level: 3, members: [{fields}], show_if_no_docstring: true, show_root_full_path: false}}"
    return f"::: {item.__module__}.{item.__qualname__}\n    options: {options}\n"


def struct_link(item: type[Struct], page: str) -> str:
    """Return the entry of a message, or settings, that stand on the page of another protocol."""
    return f"### {item.__name__}\n\n[As `{page}` has it]({page}.md#{item.__module__}.{item.__qualname__}).\n"


def title(kind: type[Protocol]) -> str:
    """Return the first line of the docstring of a protocol's module, which is its full name."""
    module = inspect.getmodule(kind)
    return ((docstring(module) if module else "") or kind.__name__).splitlines()[0].rstrip(".")


def purpose(kind: type[Protocol]) -> str:
    """Return what a protocol is for, in a word."""
    return "minimising costs" if kind.traits.costs else "satisfaction"


def structs(kind: type[Protocol]) -> Iterator[type[Struct]]:
    """Yield the messages that a protocol's robots receive, and its settings."""
    yield from get_args(kind.messages) or (kind.messages,)
    if type(kind.settings) is not Settings:
        yield type(kind.settings)


# Commands


def command_reference(command: click.Command, path: str, depth: int) -> Iterator[str]:
    """Yield the reference of a command and of those below it: what `--help` shows, options in their groups.

    mkdocs-click would list the options without the groups.
    """
    names = cli.context_settings.get("help_option_names")
    context = click.Context(command, info_name=path, help_option_names=names, max_content_width=82, terminal_width=82)
    usage, options = context.make_formatter(), context.make_formatter()
    command.format_usage(context, usage)
    groups_are_pages = click.Command if isinstance(command, click.Group) else type(command)
    groups_are_pages.format_options(command, context, options)
    yield f"{'#' * depth} {path}\n"
    for paragraph in re.split(r"\n\n+", inspect.cleandoc(command.help or "").partition("\f")[0]):
        shown = paragraph.removeprefix("\b\n")
        yield f"{shown}\n" if shown == paragraph else f"```text\n{shown}\n```\n"
    yield f"```text\n{usage.getvalue()}\n{options.getvalue().rstrip()}\n```\n"
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None and not below.hidden:
                yield from command_reference(below, f"{path} {name}", depth + 1)


# Examples


def example_pages() -> dict[str, str]:
    """Return a page for each example, with all its files."""
    return {f"examples/{folder.name}/index.md": example_page(folder) for folder in sorted(DOCS.glob("examples/*"))}


def example_page(folder: Path) -> str:
    """Return the page of one example."""
    sources = sorted(path for path in folder.rglob("*") if path.suffix in LANGUAGES and "__pycache__" not in path.parts)
    shown = [f"## {path.relative_to(folder)}\n\n```{LANGUAGES[path.suffix]}\n{path.read_text().rstrip()}\n```\n"
             for path in sources]  # fmt: skip
    return f"# Example: {folder.name}\n\nThe files of `docs/examples/{folder.name}/`.\n\n" + "\n".join(shown)
