"""What the project and its packages state and import, read without running them."""

import ast
import re
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.paths import ROOT

SOURCE = ROOT / "src"
PACKAGES = tuple(sorted(path.parent.name for path in SOURCE.glob("*/package.xml")))
PYTHON_PACKAGES = tuple(name for name in PACKAGES if (SOURCE / name / name).is_dir())
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@dataclass(frozen=True)
class Import:
    """One import of one top-level module."""

    module: str
    path: Path
    line: int

    def __str__(self) -> str:
        return f"{self.path.relative_to(SOURCE)}:{self.line} imports {self.module}"


@cache
def imports_in(path: Path) -> list[Import]:
    """Every import in a file, also those inside functions; relative ones stay inside a package."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(), filename=str(path))):
        if isinstance(node, ast.Import):
            found += [Import(alias.name.split(".")[0], path, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.append(Import(node.module.split(".")[0], path, node.lineno))
    return found


def imports_of(package: str) -> list[Import]:
    """Every import in a package's Python code and launch files."""
    folders = (SOURCE / package / package, SOURCE / package / "launch")
    paths = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    return [found for path in paths for found in imports_in(path)]


def manifest(package: str) -> ElementTree.Element:
    """The package's package.xml."""
    return ElementTree.parse(SOURCE / package / "package.xml").getroot()


def depends(package: str) -> set[str]:
    """What package.xml names as needed when it runs."""
    tags = ("depend", "exec_depend", "build_export_depend")
    return {element.text for tag in tags for element in manifest(package).findall(tag)}


def names(requirements: list) -> set[str]:
    """The distributions that requirements name; included groups are left out."""
    texts = [line for line in requirements if isinstance(line, str)]
    return {re.match(r"[\w.-]+", text)[0] for text in texts}


def required() -> set[str]:
    """The distributions that `pip install .` brings."""
    return names(PYPROJECT["project"]["dependencies"])


def optional() -> set[str]:
    """The distributions that extras and groups bring."""
    lists = [*PYPROJECT["project"]["optional-dependencies"].values()]
    lists += PYPROJECT["dependency-groups"].values()
    return set().union(*map(names, lists)) - required()


def console_scripts(package: str) -> dict[str, str]:
    """Executable -> module:function."""
    return PYPROJECT["project"]["entry-points"].get(package, {})
