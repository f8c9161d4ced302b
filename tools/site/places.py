"""Where the pages of the repository stand in the site, and the links between them."""

import posixpath
import re
from collections.abc import Callable

REPOSITORY_PAGES = {  # pages outside of docs/
    "bags/README.md": "guides/look_at_bags.md",
    "docker/README.md": "guides/docker.md",
    "examples/my_model/README.md": "guides/my_model.md",
    "examples/pusht/README.md": "explanation/pusht.md",
    "CONTRIBUTING.md": "reference/contributing.md",
    "CHANGELOG.md": "reference/changelog.md",
}
OTHER_PLACES = {**REPOSITORY_PAGES, "docs/decisions": "decisions/index.md"}
LINK = re.compile(r"(?<!!)\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(([^)\s]+)\)|!\[([^\]]*)\]\(([^)\s]+)\)")
FENCE = re.compile(r"^( *)(```|~~~).*?^\1\2 *$", re.DOTALL | re.MULTILINE)


def repository_path(place: str) -> str:
    """Return where a page of the site stands in the repository."""
    sources = {site: source for source, site in REPOSITORY_PAGES.items()}
    return sources.get(place, f"docs/{place}")


def site_place(path: str) -> str:
    """Return the place in the site of a path in the repository; "": it has none there."""
    if path in OTHER_PLACES:
        return OTHER_PLACES[path]
    return path.removeprefix("docs/") if path.startswith("docs/") else ""


def outside_fences(text: str, change: Callable[[str], str]) -> str:
    """Change the parts of a page that are no fenced code."""
    parts, end = [], 0
    for fence in FENCE.finditer(text):
        parts += [change(text[end : fence.start()]), fence[0]]
        end = fence.end()
    return "".join([*parts, change(text[end:])])


def site_links(text: str, place: str) -> str:
    """Return a page whose relative links lead to pages of the site.

    A link to a file that has no page there, such as one of the code, becomes its text.
    """
    source = repository_path(place)

    def change(match: re.Match[str]) -> str:
        label, target = (match[1], match[2]) if match[2] else (match[3], match[4])
        name, mark, anchor = target.partition("#")
        if not name or re.match(r"[a-z]+:", target):
            return match[0]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(source), name))
        other = site_place(path)
        if not other and not path.startswith("docs"):
            return label
        there = posixpath.relpath(other, posixpath.dirname(place) or ".")
        return f"{'' if match[2] else '!'}[{label}]({there}{mark}{anchor})"

    return outside_fences(text, lambda part: LINK.sub(change, part))
