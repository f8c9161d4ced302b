"""Writes the table of packages in docs/explanation/architecture.md and the versions of package.xml.

What a package holds is the docstring of its `__init__.py`. Its rooms, and which may import which,
are the contracts of import-linter in pyproject.toml.

./env python tools/packages.py
"""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/explanation/architecture.md"
BEGIN, END = "<!-- packages: made by tools/packages.py -->\n", "<!-- end of packages -->\n"
HEAD = "| package | holds | rooms |\n| --- | --- | --- |\n"


def page() -> str:
    """Return the page with the table as the packages are now."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


def table() -> str:
    """Return a line for each package: those that import others before those that they import."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    packages, *rooms = (one for one in contracts if one["type"] == "layers")
    rooms_of = {one["containers"][0]: rooms_line(one) for one in rooms}
    names = (name for layer in packages["layers"] for name in layer.split(" | "))
    return HEAD + "".join(row(name, rooms_of.get(name) or files_line(name)) for name in names)


def row(name: str, rooms: str) -> str:
    """Return a package's line of the table."""
    return f"| `{name}` | {summary(name)} | {rooms} |\n"


def summary(name: str) -> str:
    """Return the first line of a package's docstring; without one it is an error."""
    text = ast.get_docstring(ast.parse((folder(name) / "__init__.py").read_text(encoding="utf-8")))
    if not text:
        raise SystemExit(f"{name}/__init__.py has no docstring")
    return text.splitlines()[0]


def folder(name: str) -> Path:
    """Return the folder of a package's modules."""
    return ROOT / "src" / name / name


def rooms_line(contract: dict[str, Any]) -> str:
    """Return the rooms of a package: each imports only what is to its right."""
    return " > ".join(layer.replace(" | ", r" \| ") for layer in contract["layers"])


def files_line(name: str) -> str:
    """Return the modules and folders of a package for which there is no contract."""
    inside = (one for one in folder(name).iterdir() if one.name[0] != "_")
    code = {one.stem for one in inside if one.suffix == ".py" or (one / "__init__.py").exists()}
    return ", ".join(sorted(code))


def manifests() -> dict[Path, str]:
    """Return the text of each package.xml, with the version of pyproject.toml."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    version = f"<version>{settings['project']['version']}</version>"
    paths = sorted(ROOT.glob("src/*/package.xml"))
    return {
        path: re.sub("<version>.*</version>", version, path.read_text(encoding="utf-8"))
        for path in paths
    }


if __name__ == "__main__":
    for path, text in {PAGE: page(), **manifests()}.items():
        path.write_text(text, encoding="utf-8")
