"""Memory of a learner after 10,000 pushes, and how long one training takes.

    ./env python -m benchmarks.speed.learner --out results/learner --like results/learning/rough_101

All state of a learner is its log: one with so many pushes is written, of the pushes of a laboratory
again and again with other digits, and opened.
"""

import argparse
import resource
import time
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from typing import Final

from benchmarks.report import Figure, report
from benchmarks.results.learning import pushes_of
from sain_core.output import remove
from sain_lab.keeping.laboratory import PHYSICS, PLANAR, OpenLaboratory
from sain_lab.learner import Learner
from sain_lab.training import LONGEST, Training
from sain_model.compute.kernel_store import compile_kernels

PUSHES: Final = 10_000
MOST_MEMORY: Final = 500.0  # [MB]


def fill(folder: Path, like: Path) -> None:
    """Write the log of a laboratory with so many pushes."""
    some = list(pushes_of(like))
    with OpenLaboratory(folder) as laboratory:
        for number, one in enumerate(islice(cycle(some), PUSHES)):
            run, after = number // len(some), one.after.copy()
            after[:, 0] += 1e-9 * run
            again = replace(one, after=after, episode=f"{run}/{one.episode}", identity="")
            errors = {PLANAR: 2.0, PHYSICS: 1.5}
            laboratory.append({"kind": "push", **again.record(), "errors": errors, "turns": errors})


def main() -> None:
    """Fill a laboratory, learn one more push there, and train."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--like", type=Path, required=True, help="laboratory with pushes")
    options = parser.parse_args()
    compile_kernels()
    folder = (options.out / "laboratory").absolute()
    remove(folder)
    fill(folder, options.like)
    start = time.perf_counter()
    with Learner(OpenLaboratory(folder), trains=False) as learner:
        opened = time.perf_counter() - start
        one = next(pushes_of(options.like))
        after = one.after.copy()
        after[:, 0] += 1e-6
        start = time.perf_counter()
        lesson = learner.observe(replace(one, after=after, episode="last", identity="last"))
        assert lesson.learned, lesson.reason
        observed = time.perf_counter() - start
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        training = Training.start(learner.laboratory, 0, learner.pushes)
        training.wait()
        if training.problem:
            raise SystemExit(training.problem)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    figures = [
        Figure("memory after 10,000 pushes", memory, "MB", at_most=MOST_MEMORY),
        Figure("processor time of a training on 3,000 pushes", used.ru_utime, "s", at_most=LONGEST),
        Figure("time to open the laboratory", opened, "s"),
        Figure("time to learn from a push", observed, "s"),
    ]
    report("The learner after 10,000 pushes", figures, options.out / "results.json")


if __name__ == "__main__":
    main()
