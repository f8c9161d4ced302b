"""The page itself: the template with style, script and data put in, and nothing from elsewhere.

What a bag holds is text of strangers. It stands in the page as JSON in which no character can end
the script that holds it, and the page's script shows it as text and never as markup. On top of
that the page's policy lets nothing run or load but what was written here.
"""

import base64
import hashlib
import json
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from sain_bags.report.bundling import bundle
from sain_core.drawing.palette import DARK, PALETTE
from sain_core.storage import write_whole

SCRIPT: Final = "page.js"
UNSAFE: Final = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def render_page(data: dict[str, Any]) -> str:
    """Return the whole page for what `read_content` found."""
    style = _fill(_part("page.css"), light=PALETTE.css(), dark=DARK.css())
    script = bundle(SCRIPT, _part)
    return _fill(
        _part("page.html"),
        title=escape(data["bag"]["name"]),
        policy=_policy(style, script),
        style=style,
        data=json.dumps(data, allow_nan=False, separators=(",", ":")).translate(UNSAFE),
        script=script,
    )


def write_page(path: Path, data: dict[str, Any]) -> Path:
    """Write the page, whole or not at all; raises `OutputError`."""
    return write_whole(path, render_page(data).encode())


def _policy(style: str, script: str) -> str:
    return (
        f"default-src 'none'; style-src {_hash(style)}; script-src {_hash(script)};"
        " img-src data:; base-uri 'none'; form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"


def _fill(template: str, **parts: str) -> str:
    """Put each part in its place; what a part holds is not looked at again."""
    pieces = template.split("@@")
    for place in range(1, len(pieces), 2):
        pieces[place] = parts[pieces[place]]
    return "".join(pieces)


def _part(name: str) -> str:
    return (files("sain_bags.report") / "page" / name).read_text(encoding="utf-8")
