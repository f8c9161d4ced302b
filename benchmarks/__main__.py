"""All benchmarks one after the other: ``python -m benchmarks [NAME ...]``."""

import importlib
import pkgutil
import sys

import benchmarks

HELPERS = {"__main__", "report", "wire"}


def main() -> int:
    """Run the benchmarks that are named, or all of them."""
    known = sorted({module.name for module in pkgutil.iter_modules(benchmarks.__path__)} - HELPERS)
    names = sys.argv[1:] or known
    unknown = [name for name in names if name not in known]
    if unknown:
        print(f"no benchmark {', '.join(unknown)}; there are: {', '.join(known)}", file=sys.stderr)
        return 2
    sys.argv = sys.argv[:1]
    for name in names:
        importlib.import_module(f"benchmarks.{name}").main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
