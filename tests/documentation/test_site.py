"""The site, opened as files: no warnings, every link leads somewhere, and no network is needed."""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urldefrag, urljoin, urlsplit

import pytest

from tests.paths import ROOT
from tests.sain_bags.browser import opened_browser

BUILD = ("mkdocs", "build", "--strict", "--config-file", "tools/site/mkdocs.yml", "--site-dir")
SHOWN = ("index", "reference/results", "reference/parameters", "reference/commands/sain_eval")


class Page(HTMLParser):
    """The links, resources and anchors of a page."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.resources: list[str] = []
        self.anchors: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        has = {name: value or "" for name, value in attrs}
        self.anchors |= {has[name] for name in ("id", "name") if name in has}
        if tag == "a" and "href" in has:
            self.links.append(has["href"])
        if tag in ("script", "img", "iframe") and "src" in has:
            self.resources.append(has["src"])
        if tag == "link" and has.get("rel") in ("stylesheet", "icon", "preconnect"):
            self.resources.append(has["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, built as `make docs` builds it."""
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", *BUILD, folder], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING " not in done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site):
    """Every page, by its file in the site."""
    return {str(path.relative_to(site)): Page(path) for path in site.rglob("*.html")}


@pytest.fixture(scope="module")
def browser():
    with opened_browser() as browser:
        yield browser


def test_every_page_of_docs_is_in_the_site(pages):
    for path in (ROOT / "docs").rglob("*.md"):
        assert str(path.relative_to(ROOT / "docs").with_suffix(".html")) in pages


def test_every_link_and_anchor_leads_somewhere(site, pages):
    wrong = []
    for name, page in pages.items():
        for link in page.links + page.resources:
            target, anchor = urldefrag(urljoin(f"http://site/{name}", link))
            if urlsplit(target).netloc != "site" or name == "404.html":
                continue
            path = unquote(urlsplit(target).path).lstrip("/")
            there = pages.get(path)  # a folder is none: under file:// it opens as a listing
            lost = there is None and not (site / path).is_file()
            if lost or (there and anchor and unquote(anchor) not in there.anchors):
                wrong.append(f"{name}: {link}")
    assert len(pages) > 60
    assert wrong == []


def test_no_resource_is_elsewhere(pages):
    elsewhere = [one for page in pages.values() for one in page.resources if "//" in one]
    assert elsewhere == []


@pytest.mark.parametrize("name", SHOWN)
def test_a_page_fits_and_asks_nobody_else(browser, site, name):
    browser.open(site / f"{name}.html", width=390)
    assert browser.complaints() == []
    own = (site.as_uri(), "data:")
    assert [asked for asked in browser.requests() if not asked.startswith(own)] == []
    assert browser.run("return document.documentElement.scrollWidth - window.innerWidth") <= 0
