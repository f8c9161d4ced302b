"""Table and picture of `benchmarks.peers`."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np
from matplotlib.figure import Figure as Picture

from sain_core.drawing.figures import TEXT, new_figure, style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.seeding import generator
from sain_eval.loop.statistics import Interval, bootstrap_mean, wilson_interval
from sain_model.evaluation.markdown import markdown_table

Lines = Sequence[dict[str, Any]]  # of the journal


@dataclass(frozen=True)
class PeerPoint:
    """A planner with so many samples: what it solves, in how many pushes, in what time."""

    planner: str
    samples: int
    scenes: int
    solved: Interval
    pushes: Interval
    milliseconds: float

    @property
    def cells(self) -> list[str]:
        """The row of the table."""
        rate, pushes = self.solved, self.pushes
        return [
            self.planner,
            str(self.samples),
            f"{rate.estimate * self.scenes:.0f} of {self.scenes}",
            f"{100 * rate.low:.0f} to {100 * rate.high:.0f} %",
            f"{pushes.estimate:.2f} [{pushes.low:.2f}, {pushes.high:.2f}]",
            f"{self.milliseconds:.1f}",
        ]

    def equals(self, other: "PeerPoint") -> bool:
        """Tell whether it solves as many scenes in no more pushes."""
        solved = self.solved.estimate >= other.solved.estimate
        return solved and self.pushes.estimate <= other.pushes.estimate


def points(lines: Lines) -> list[PeerPoint]:
    """Return a point for each planner and number of samples."""
    ordered = sorted(lines, key=lambda line: line["key"][:2])
    return [_point(list(group)) for _, group in groupby(ordered, lambda line: line["key"][:2])]


def _point(lines: Lines) -> PeerPoint:
    solved = [line for line in lines if line["success"][-1]]
    pushes = np.array([float(line["pushes"][-1]) for line in solved])
    seconds = np.concatenate([line["seconds"] for line in lines])
    name, samples = lines[0]["key"][:2]
    return PeerPoint(
        name,
        samples,
        len(lines),
        wilson_interval(len(solved), len(lines)),
        bootstrap_mean(pushes, generator(0, "peers", name, samples)),
        1e3 * float(seconds.mean()),
    )


def table(lines: Lines, ours: Sequence[str]) -> str:
    """Return the rows; of ours with the time of the cheapest peer that equals it, over its own."""
    every = points(lines)
    peers = [point for point in every if point.planner not in ours]
    head = ["planner", "K", "solved", "95 %", "pushes", "ms a plan", "cheapest equal peer / this"]
    return markdown_table(head, [[*point.cells, _ratio(point, peers, ours)] for point in every])


def _ratio(point: PeerPoint, peers: Sequence[PeerPoint], ours: Sequence[str]) -> str:
    if point.planner not in ours or not peers:
        return ""
    times = [peer.milliseconds for peer in peers if peer.equals(point)]
    return f"{min(times) / point.milliseconds:.1f}" if times else "none equals it"


def draw(lines: Lines, ours: Sequence[str]) -> Picture:
    """Draw success and pushes against the time of a plan, a curve for each planner."""
    picture = new_figure(6.6, 3.8)
    every, (left, right) = points(lines), picture.subplots(1, 2)
    colours = (
        PALETTE.predicted, PALETTE.mid, PALETTE.goal, PALETTE.target, PALETTE.learned,
        PALETTE.alarm, PALETTE.other,
    )  # fmt: skip
    names = sorted({p.planner for p in every}, key=lambda n: (n not in ours, n))
    for name, colour in zip(names, colours, strict=False):
        own = [point for point in every if point.planner == name]
        times = [point.milliseconds for point in own]
        style = {"color": colour, "linestyle": "-" if name in ours else "--", "marker": "o"}
        rates = [100 * point.solved.estimate for point in own]
        left.plot(times, rates, markersize=4, label=name.replace("_", " "), **style)
        right.plot(times, [p.pushes.estimate for p in own], markersize=4, **style)
    style_axes(left, grid="both", ylabel="scenes solved at 0.5 cm [%]")
    style_axes(right, grid="both", ylabel="pushes of those, mean")
    for axes in (left, right):
        axes.set_xscale("log")
    left.set_ylim(0, 103)
    picture.supxlabel("processor time of a plan [ms]", fontsize=TEXT)
    picture.legend(frameon=False, ncols=4, loc="outside upper center", fontsize=TEXT - 0.5)
    return picture
