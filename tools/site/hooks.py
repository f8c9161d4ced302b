"""What MkDocs does beyond its configuration: generated pages, links out of docs/, and marks.

MkDocs calls the functions ``on_...``. Nothing that they make is written into docs/. It is started
as ``python -m mkdocs`` in the root of the checkout, where `tools.site` is found.
"""

from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

from tools.site import api, commands, decisions, messages
from tools.site.notes import with_notes
from tools.site.places import REPOSITORY_PAGES, site_links

ROOT = Path(__file__).resolve().parents[2]
ASSETS = ("site.css", "iframe-worker.js")


def generated_pages() -> dict[str, str]:
    """Return the Markdown of every page that is made from the code, by its place in the site."""
    return {**commands.pages(), **messages.pages(), **api.pages(), **decisions.pages(ROOT)}


def on_files(files: Files, config: Any) -> Files:
    """Add the generated pages, those that stand elsewhere in the repository, style and script."""
    for place, text in generated_pages().items():
        files.append(File.generated(config, place, content=text))
    for source, place in REPOSITORY_PAGES.items():
        files.append(File.generated(config, place, content=(ROOT / source).read_text()))
    for name in ASSETS:
        path = Path(__file__).with_name(name)
        files.append(File.generated(config, f"assets/{name}", abs_src_path=str(path)))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Return a page with the links of the site, and its marks as notes."""
    place = page.file.src_uri
    return with_notes(site_links(markdown, place))
