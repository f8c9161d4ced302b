"""What the pages point to exists: links, headings, paths, modules, benchmarks and executables."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.paths import ROOT
from tests.workspace.source_tree import PYTHON_PACKAGES, SOURCE, console_scripts

PAGES = sorted(
    path
    for path in [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *ROOT.glob("*/README.md"),
        *(ROOT / "examples").rglob("*.md"),
    ]
    if path.name != "CHANGELOG.md"
)
FENCED = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^)\s]+)\)|(?:src|href)=\"([^\"]+)\"|^\[\w+\]: (\S+)", re.MULTILINE)
FOLDERS = "src|tests|docs|tools|benchmarks|examples|docker|bags/README"
NAMED_PATH = re.compile(rf"(?<![\w/.-])((?:{FOLDERS})/[\w./-]+\.(?:py|md|sh|json|yaml|png))\b")
MODULE = re.compile(rf"`((?:{'|'.join(PYTHON_PACKAGES)})(?:\.\w+)+)")
PACKAGE_PATH = re.compile(rf"`((?:{'|'.join(PYTHON_PACKAGES)})/[\w./]+)`")
BENCHMARK = re.compile(r"\bbenchmarks\.(\w+(?:\.\w+)*)")
SCRIPTS = {name: console_scripts(name) for name in PYTHON_PACKAGES}
EXECUTABLE = re.compile(r"ros2 run (sain_\w+) (\w+)")


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    text = FENCED.sub("", page.read_text())
    titles = re.findall(r"^#+ +(.*?)\s*$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def broken_links(page: Path) -> Iterator[str]:
    """The relative links of a page that lead nowhere."""
    for match in LINK.finditer(FENCED.sub("", page.read_text())):
        target = match[1] or match[2] or match[3]
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        path = (page.parent / name).resolve() if name else page
        if not path.exists() or (anchor and anchor not in anchors(path)):
            yield target


def exists(module: str) -> bool:
    """Whether a dotted name is a module, or something that a module defines."""
    parts = module.split(".")
    for length in range(len(parts), 0, -1):
        path = SOURCE / parts[0] / Path(*parts[:length])
        file = path.with_suffix(".py") if path.with_suffix(".py").exists() else path / "__init__.py"
        if file.exists():
            return length == len(parts) or bool(
                re.search(rf"^\s*(?:def |class )?{parts[length]}\b", file.read_text(), re.MULTILINE)
            )
    return False


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_names_of_a_page_lead_somewhere(page):
    text = page.read_text()
    assert list(broken_links(page)) == []
    assert [name for name in NAMED_PATH.findall(text) if not (ROOT / name).exists()] == []
    assert [name for name in MODULE.findall(text) if not exists(name)] == []
    paths = [SOURCE / name.partition("/")[0] / name for name in PACKAGE_PATH.findall(text)]
    assert [str(path) for path in paths if not path.exists()] == []
    benchmarks = [ROOT / "benchmarks" / name.replace(".", "/") for name in BENCHMARK.findall(text)]
    assert [
        path for path in benchmarks if not (path.with_suffix(".py").exists() or path.is_dir())
    ] == []
    runs = EXECUTABLE.findall(text)
    assert [run for run in runs if run[1] not in SCRIPTS.get(run[0], {})] == []


def test_a_broken_link_and_a_missing_heading_are_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# A `code` title: it's here\n[a](#a-code-title-its-here) [b](#gone) [c](gone.md) "
        '[d](https://example.org)\n<img src="gone.png">\n```\n[e](fenced.md)\n```\n[f]: lost.md\n'
    )
    assert list(broken_links(page)) == ["#gone", "gone.md", "gone.png", "lost.md"]
