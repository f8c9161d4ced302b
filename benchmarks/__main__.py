"""The benchmarks: ``./env python -m benchmarks`` lists them, ``... NAME`` runs one or a room.

A name is that of a benchmark or of a room. Each is a module that takes options:
``./env python -m benchmarks.ROOM.NAME --help``.
"""

import pkgutil
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path

import benchmarks

READERS = "tyro.cli", "read_options", "ArgumentParser", "commands.verify"


def modules() -> Iterator[tuple[str, str]]:
    """Yield the benchmarks: the name of each module that reads options, and its first line."""
    for found in pkgutil.walk_packages(benchmarks.__path__, "benchmarks."):
        place = Path(*found.name.split("."))
        path = place / "__main__.py" if found.ispkg else place.with_suffix(".py")
        source = Path(benchmarks.__path__[0]).parent / path
        text = source.read_text(encoding="utf-8") if source.exists() else ""
        reads_options = any(f"{name}(" in text for name in READERS)
        if reads_options and not found.name.endswith("__main__"):
            first = text.lstrip("r").removeprefix('"""').partition("\n")[0]
            yield found.name, first.rstrip('"')


def main() -> int:
    """List the benchmarks, or run those that are named, with the options behind the names."""
    lines = dict(modules())
    given = sys.argv[1:]
    if not given or {"-h", "--help"} & set(given):
        print(__doc__)
        for name, line in lines.items():
            print(f"  {name.removeprefix('benchmarks.'):28} {line}")
        return 0
    names = [name for name in lines if given[0] in name.split(".")[1:]]
    if not names:
        allowed = ", ".join(name.removeprefix("benchmarks.") for name in lines)
        print(f"no benchmark {given[0]!r}; there are: {allowed}", file=sys.stderr)
        return 2
    for name in names:
        sys.argv = [name, *given[1:]]
        runpy.run_module(name, run_name="__main__")
    return 0


if __name__ == "__main__":
    sys.exit(main())
