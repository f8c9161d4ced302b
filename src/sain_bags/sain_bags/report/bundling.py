"""The page's ES modules as one script. Each file keeps its own scope, as in a browser."""

import re
from collections.abc import Callable
from typing import Final

IMPORT: Final = re.compile(r'^import \{([^}]*)\} from "\./([\w.]+)";\n', re.MULTILINE)
EXPORT: Final = re.compile(r"^export \{([^}]*)\};\n", re.MULTILINE)


def bundle(entry: str, read: Callable[[str], str]) -> str:
    """Return a module with all that it imports, directly or not, as one script.

    Each file becomes a function, so the same name in two files means two things. A file shares the
    names of its line ``export { a, b };`` and sees those of its lines ``import { a } from "./b";``.

    Args:
        entry: the name of the first module.
        read: returns the text of a module.

    Raises:
        ValueError: a file imports what another does not export, or files import each other.
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
