"""Circles between files: ``./env python tools/circles.py [PACKAGE ...]``, a part of `make lint`.

No file may import itself by way of others, be it inside of a function. Imports for type checkers
alone (``if TYPE_CHECKING``) are allowed.
"""

import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import grimp

ROOT: Final = Path(__file__).resolve().parents[1]
ADVICE: Final = "move what both need into one of these files, or into one that imports neither"
Circle = tuple[str, ...]  # modules; each imports the next one, and the last one the first


def own_packages() -> list[str]:
    """Return the packages of this repository."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    return ["benchmarks", *settings["tool"]["importlinter"]["root_packages"]]


def import_graph(packages: list[str], for_types: bool = False) -> grimp.ImportGraph:
    """Return who imports whom; with `for_types` also by imports for type checkers alone."""
    return grimp.build_graph(*packages, exclude_type_checking_imports=not for_types, cache_dir=None)


def find_circles(graph: grimp.ImportGraph) -> list[Circle]:
    """Return the shortest circle through each module that is in one; each circle once."""
    found = set()
    for module in graph.modules:
        imported = graph.find_modules_directly_imported_by(module)
        chains = (graph.find_shortest_chain(other, module) for other in sorted(imported))
        if shortest := min(filter(None, chains), key=len, default=None):
            first = shortest.index(min(shortest))
            found.add(tuple(shortest[first:] + shortest[:first]))
    return sorted(found)


def describe(graph: grimp.ImportGraph, circle: Circle) -> str:
    """Return a circle in words, a line for each of its imports."""
    lines = []
    for importer, imported in zip(circle, (*circle[1:], circle[0]), strict=True):
        details = graph.get_import_details(importer=importer, imported=imported)
        lines.append(f"  {file_of(importer)}:{details[0]['line_number']} imports {imported}")
    return "\n".join(["a circle between files:", *lines])


def file_of(module: str) -> str:
    """Return the path of a module's file, from the repository where it is in it."""
    spec = find_spec(module)
    path = Path(spec.origin if spec and spec.origin else module).resolve()
    return str(path.relative_to(ROOT) if path.is_relative_to(ROOT) else path)


def main(packages: list[str]) -> int:
    """Print each circle; return 1 if there is one."""
    sys.path.insert(0, str(ROOT))
    graph = import_graph(packages or own_packages())
    circles = find_circles(graph)
    for circle in circles:
        print(describe(graph, circle))
    if circles:
        print(ADVICE)
        return 1
    print(f"circles: none between {len(graph.modules)} files")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
