"""What the packages under src/ say of themselves and import, read without running them."""

import ast
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from tests.paths import ROOT

SOURCE = ROOT / "src"
PACKAGES = tuple(sorted(path.parent.name for path in SOURCE.glob("*/package.xml")))
PYTHON_PACKAGES = tuple(name for name in PACKAGES if (SOURCE / name / "setup.py").exists())


@dataclass(frozen=True)
class Import:
    """One import of one top-level module."""

    module: str
    path: Path
    line: int

    def __str__(self) -> str:
        return f"{self.path.relative_to(SOURCE)}:{self.line} imports {self.module}"


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


def setup_arguments(package: str) -> dict[str, object]:
    """The literal arguments of setup() in a package's setup.py."""
    tree = ast.parse((SOURCE / package / "setup.py").read_text())
    call = next(
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup"
    )
    arguments = {}
    for keyword in call.keywords:
        try:
            arguments[keyword.arg] = ast.literal_eval(keyword.value)
        except ValueError:
            arguments[keyword.arg] = ast.unparse(keyword.value)
    return arguments


def requirements_of(package: str) -> set[str]:
    """The distributions that a package needs, those of its optional extras too."""
    arguments = setup_arguments(package)
    extras = arguments.get("extras_require", {}).values()
    return {*arguments["install_requires"], *(name for names in extras for name in names)}


def console_scripts(package: str) -> dict[str, str]:
    """Executable -> module:function."""
    lines = setup_arguments(package).get("entry_points", {}).get("console_scripts", [])
    return {name.strip(): target.strip() for name, target in (line.split("=") for line in lines)}
