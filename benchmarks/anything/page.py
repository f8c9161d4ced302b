# ruff: noqa: E501 - lines of the page
"""docs/reference/anything.md, from the file of results: no number of it is written by hand."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, Final

import numpy as np

from benchmarks.report import markdown_table

ABOUT: Final = """# Push Anything

For users who ask how fast bodies come to goals. C3+ (Push Anything, arXiv 2510.19974) pushes 24 bodies with a Franka
arm; the times of its 760 trials are public. Here a simulated arm pushes the same bodies by the same protocol.

<!-- not tested: needs outlines of the bodies, and hours -->
```
make anything DATA=~/data/push_anything
```

**What differs.** Theirs is hardware, with FoundationPose on a GPU and two computers. Ours is simulated in MuJoCo, at real-time
factor 1: bodies of full height stand on flat bottoms, with drawn friction. Outlines and heights are those of their meshes. Arm, camera,
vision, planner, model and recorder share the cores of one computer with the simulation. Poses come from tags or outlines in the camera's
images. For tags its field of view is 31 degrees high, as those of letters are 18 mm wide. The arms keep the limits of speed of their makers.

**Protocol.** Random goals one after another, 2 cm and 0.1 rad: x from 0.50 to 0.51 m, y within 0.30 m, any heading, where the tool
finds room around the body. A goal's time runs from its message to the first scene at rest within tolerance, as the camera sees it.

**Columns.** Times are seconds to a goal, over the goals that were reached; those of C3+ stand beside ours. The ratio is our median over
theirs. Flat: whether a body of one cross-section is a fair model of the mesh. Of several bodies at once, C3+'s means
are those that the paper states, over all its bodies.

![Six bodies to their goals, at twice the speed](../media/anything.gif)
"""
MADE: Final = """## Provenance

A run that is interrupted continues, also with another commit. The seed is that of goals, masses and friction.

"""
QUANTILE: Final = 90
SEEN: Final = {"tags": "seen by tags", "outlines": "seen by outlines, without tags"}
TOGETHER: Final = {2: "96", 3: "192", 4: "318"}  # [s], the paper's means over all its bodies
UNBROKEN: Final = "limits {}, contacts {}"  # of a report
FLAT: Final = ("yes", "roughly")  # bodies of which a flat one is a fair model


def page(found: Mapping[str, Any]) -> str:
    """Return the page in Markdown."""
    return "\n".join(part.strip() + "\n" for part in (ABOUT, *_tables(found), _made(found)))


def _tables(found: Mapping[str, Any]) -> Iterator[str]:
    trials = found["trials"]
    for robot, see in dict.fromkeys(tuple(key.split(" ")[:2]) for key in trials):
        ours = {
            key.split(" ")[2]: rows
            for key, rows in trials.items()
            if key.startswith(f"{robot} {see} ") and rows["goals"]
        }
        alone = {names: rows for names, rows in ours.items() if "+" not in names}
        together = {names: rows for names, rows in ours.items() if names not in alone}
        for some, what in ((alone, ""), (together, ", several bodies at once")):
            if some:
                yield f"## {robot}, {SEEN[see]}{what}"
                yield _table(found, some)
                yield _summary(found, some)


def _table(found: Mapping[str, Any], ours: Mapping[str, Any]) -> str:
    rows = []
    for names, trial in ours.items():
        goals, theirs = trial["goals"], found["theirs"].get(names)
        times = _times(goals)
        ratio = f"{np.median(times) / np.median(theirs):.2f}" if theirs and times else "-"
        median, *others = zip(_numbers(times), _numbers(theirs or ()), strict=True)
        if together := TOGETHER.get(names.count("+") + 1):
            others[0] = (others[0][0], together)
        flat = found["flat"].get(names) or "-"
        solved = f"{len(times)}/{len(goals)}"
        rows.append([names.replace("_", " "), solved, *median, ratio, *chain(*others), flat])
    kinds = [[f"{kind} [s]", "C3+"] for kind in ("median", "mean", f"{QUANTILE} %", "worst")]
    header = ["body", "reached", *kinds[0], "ratio", *chain(*kinds[1:]), "flat"]
    return markdown_table(header, rows)


def _numbers(times: Sequence[float]) -> list[str]:
    if not times:
        return ["-"] * 4
    values = np.median(times), np.mean(times), np.percentile(times, QUANTILE), max(times)
    return [f"{value:.1f}" for value in values]


def _times(goals: Sequence[Mapping[str, Any]]) -> list[float]:
    return [goal["seconds"] for goal in goals if goal["seconds"] is not None]


def _summary(found: Mapping[str, Any], ours: Mapping[str, Any]) -> str:
    flat = {name: one for name, one in ours.items() if (found["flat"].get(name) or "yes") in FLAT}
    goals = [goal for one in flat.values() for goal in one["goals"]]
    if not goals:
        return "No body is flat, or roughly so."
    times = _times(goals)
    spread = f", median {np.median(times):.1f} s, worst {max(times):.1f} s" if times else ""
    at_rest = np.mean([goal["at_rest"] for goal in goals])
    busy = np.mean([goal["busy"] for goal in goals])
    reports = {text.rpartition(", tool")[0] for one in ours.values() for text in one["broken"]}
    failed = [f"{name}: {goal['failure']}" for name, one in ours.items()
              for goal in one["goals"] if goal["failure"]]  # fmt: skip
    lines = [
        f"Of the bodies that are flat, or roughly so, {len(times)} of {len(goals)} goals were reached"
        f" ({len(times) / len(goals):.1%}){spread}."
        f" No joint moved in {at_rest:.0%} of the time; the graph took {busy:.0%} of the cores.",
        *_broken(reports),
        *([f"Not reached: {'; '.join(failed)}."] if failed else []),
    ]
    return "\n\n".join(lines)


def _broken(reports: set[str]) -> Iterator[str]:
    """Yield what the arm broke, of whole trials; an interrupted one has no report."""
    if reports == {UNBROKEN}:
        yield "No joint exceeded a limit, and no part of the arm but the tool touched anything."
    elif broken := sorted(reports - {UNBROKEN}):
        yield f"Exceeded limits, and contacts that must not be: {'; '.join(broken)}."


def _made(found: Mapping[str, Any]) -> str:
    goals = [goal for trial in found["trials"].values() for goal in trial["goals"]]
    made = Counter((str(goal["seed"]), goal["commit"], goal["processor"]) for goal in goals)
    rows = [[str(count), *how] for how, count in made.items()]
    return MADE + markdown_table(["goals", "seed", "commit", "processor"], rows)
