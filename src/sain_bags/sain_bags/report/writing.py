"""The page itself: the template with style, script and data put in, and nothing from elsewhere.

What a bag holds is text of strangers. It stands in the page as JSON in which no character can end
the script that holds it, and the page's script shows it as text and never as markup. On top of
that the page's policy lets nothing run or load but what was written here.
"""

import base64
import hashlib
import json
import re
from collections.abc import Callable
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from sain_core.output import write_whole
from sain_core.view.palette import BODIES, DARK, PALETTE

SCRIPT: Final = "page.js"
IMPORT: Final = re.compile(r'^import \{([^}]*)\} from "\./([\w.]+)";\n', re.MULTILINE)
EXPORT: Final = re.compile(r"^export \{([^}]*)\};\n", re.MULTILINE)
UNSAFE: Final = {ord(sign): f"\\u{ord(sign):04x}" for sign in "<>&\u2028\u2029"}


def render_page(data: dict[str, Any]) -> str:
    """Return the whole page for what `read_content` found."""
    colours = "\n".join(f".c-{name} {{ color: var(--{name}); }}" for name in (*BODIES, "other"))
    style = _fill(_part("page.css"), light=PALETTE.css(), dark=DARK.css(), colours=colours)
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


def bundle(entry: str, read: Callable[[str], str]) -> str:
    """Return a module with all that it imports, directly or not, as one script.

    Each file becomes a function, so the same name in two files means two things. A file shares the
    names of its line ``export { a, b };`` and sees those of its lines ``import { a } from "./b";``.
    """
    shared: dict[str, set[str]] = {}
    parts: list[str] = []

    def add(name: str, above: tuple[str, ...]) -> None:
        if name in above:
            raise ValueError(f"modules import each other: {' > '.join([*above, name])}")
        if name in shared:
            return
        text = read(name)
        for names, other in IMPORT.findall(text):
            add(other, (*above, name))
            if unknown := _names(names) - shared[other]:
                raise ValueError(f"{name} imports {sorted(unknown)}, which {other} does not export")
        shared[name] = {one for names in EXPORT.findall(text) for one in _names(names)}
        text = EXPORT.sub("", IMPORT.sub(r'const {\1} = modules["\2"];\n', text))
        if left := re.search(r"^(import|export)\b.*", text, re.MULTILINE):
            raise ValueError(f"{name}: write one plain list of names, not {left[0]!r}")
        result = f"return {{ {', '.join(sorted(shared[name]))} }};"
        parts.append(f'modules["{name}"] = (() => {{\n{text}{result}\n}})();')

    add(entry, ())
    return "\n".join(['"use strict";', "(() => {", "const modules = {};", *parts, "})();"])


def _names(text: str) -> set[str]:
    return {name.strip() for name in text.split(",")} - {""}
