"""All benchmarks one after the other: ``./env python -m benchmarks [NAME ...]``.

Those that need a data set, or an hour, are modules of their own:
``./env python -m benchmarks.NAME --help``.
"""

import importlib
import pkgutil
import sys

import benchmarks

HELPERS = {
    "__main__",
    "cylinder_planning",
    "cylinder_world",
    "faults",
    "gate",
    "hostile",
    "hostile_entries",
    "hostile_flood",
    "identification",
    "live_browser",
    "live_driver",
    "live_viewer",
    "made_bags",
    "peer_figure",
    "peer_optimizers",
    "peer_planning",
    "recorder_parts",
    "report",
    "timing",
    "wire",
}
ON_DATA = {
    "ablations",
    "cylinder_push",
    "ensembles",
    "fine_tuning",
    "gates",
    "gradients",
    "graph_faults",
    "open_loop",
    "own_robot",
    "paired_pushes",
    "paper_training",
    "peers",
    "real",
    "recovery",
    "rollout_designs",
    "rough_figure",
    "rough_world",
    "shapes_collect",
    "shapes_learning",
    "soak",
    "without_history",
}


def main() -> int:
    """Run the benchmarks that are named, or all of them."""
    found = {module.name for module in pkgutil.iter_modules(benchmarks.__path__)}
    known = sorted(found - HELPERS - ON_DATA)
    if {"-h", "--help"} & set(sys.argv[1:]):
        print(__doc__, f"Names: {', '.join(known)}", sep="\n")
        return 0
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
