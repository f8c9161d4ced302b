"""Table and picture of `benchmarks.peers`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Picture
from matplotlib.ticker import NullFormatter, ScalarFormatter

from sain_core.bootstrap import bootstrap_mean
from sain_core.drawing.figures import TEXT, new_figure, style_axes
from sain_core.drawing.palette import PALETTE
from sain_core.seeding import generator
from sain_eval.loop.results import wilson_interval
from sain_model.evaluation.tables import markdown_table

Lines = Sequence[dict[str, Any]]  # of the journal

HEAD: Final = (
    "planner", "K", "solved", "95 %", "pushes", "ms a plan", "cheapest equal peer / this",
)  # fmt: skip
COLOURS: Final = (
    PALETTE.predicted, PALETTE.mid, PALETTE.goal, PALETTE.target, PALETTE.learned,
    PALETTE.alarm, PALETTE.other,
)  # fmt: skip
TICKS: Final = (10, 20, 50, 100, 200, 500, 1000, 2000)


@dataclass(frozen=True)
class PeerPoint:
    """A planner with so many samples.

    Attributes:
        planner: its name.
        samples: K.
        pushes: of each scene by its seed; None: not solved.
        milliseconds: of a plan, mean.
    """

    planner: str
    samples: int
    pushes: Mapping[int, float | None]
    milliseconds: float

    @property
    def needed(self) -> np.ndarray:
        """Pushes of the scenes that it solves."""
        return np.array([pushes for pushes in self.pushes.values() if pushes is not None])

    @property
    def share(self) -> float:
        """Share of the scenes that it solves."""
        return len(self.needed) / len(self.pushes)

    @property
    def cells(self) -> list[str]:
        """The row of the table."""
        solved, scenes = len(self.needed), len(self.pushes)
        rate = wilson_interval(solved, scenes)
        mean = bootstrap_mean(self.needed, generator(0, "peers", self.planner, str(self.samples)))
        return [
            self.planner,
            str(self.samples),
            f"{solved} of {scenes}",
            f"{100 * rate.low:.0f} to {100 * rate.high:.0f} %",
            f"{mean.estimate:.2f} [{mean.low:.2f}, {mean.high:.2f}]" if solved else "",
            f"{self.milliseconds:.0f}",
        ]

    def equals(self, other: "PeerPoint") -> bool:
        """Tell whether it solves as many of the scenes that both played, in no more pushes.

        Pushes count in the scenes that both solved.
        """
        played = [(self.pushes[s], other.pushes[s]) for s in self.pushes if s in other.pushes]
        solved = np.array([[pushes is not None for pushes in pair] for pair in played]).sum(axis=0)
        both = np.array([pair for pair in played if None not in pair], dtype=float).reshape(-1, 2)
        if not len(both) or solved[0] < solved[1]:
            return False
        return bool(both[:, 0].mean() <= both[:, 1].mean())


def points(lines: Lines, ours: Sequence[str]) -> list[PeerPoint]:
    """Return a point for each planner and number of samples, ours first."""
    played = {line["key"][0] for line in lines}
    names = [*(name for name in ours if name in played), *sorted(played - set(ours))]
    counts = sorted({line["key"][1] for line in lines})
    groups = {(name, count): [] for name in names for count in counts}  # type: ignore[var-annotated]
    for line in lines:
        groups[line["key"][0], line["key"][1]].append(line)
    return [_point(name, count, group) for (name, count), group in groups.items() if group]


def _point(name: str, samples: int, lines: Lines) -> PeerPoint:
    pushes = {
        line["key"][2]: float(line["pushes"][-1]) if line["success"][-1] else None for line in lines
    }
    seconds = np.concatenate([line["seconds"] for line in lines])
    return PeerPoint(name, samples, pushes, 1e3 * float(seconds.mean()))


def table(lines: Lines, ours: Sequence[str]) -> str:
    """Return the rows; of ours with the time of the cheapest peer that equals it, over its own."""
    every = points(lines, ours)
    peers = [point for point in every if point.planner not in ours]
    return markdown_table(HEAD, [[*point.cells, _ratio(point, peers, ours)] for point in every])


def _ratio(point: PeerPoint, peers: Sequence[PeerPoint], ours: Sequence[str]) -> str:
    if point.planner not in ours or not peers:
        return ""
    times = [peer.milliseconds for peer in peers if peer.equals(point)]
    return f"{min(times) / point.milliseconds:.1f}" if times else "none equals it"


def draw(lines: Lines, ours: Sequence[str]) -> Picture:
    """Draw success and pushes against the time of a plan, a curve for each planner."""
    picture = new_figure(6.6, 3.9)
    every, (left, right) = points(lines, ours), picture.subplots(1, 2)
    names = list(dict.fromkeys(point.planner for point in every))
    for name, colour in zip(names, COLOURS, strict=False):
        own = [point for point in every if point.planner == name]
        times, solved = [p.milliseconds for p in own], [p for p in own if len(p.needed)]
        style: dict[str, Any] = {"color": colour, "marker": "o", "markersize": 4}
        style["linestyle"] = "-" if name in ours else "--"
        left.plot(times, [100 * p.share for p in own], label=name.replace("_", " "), **style)
        right.plot([p.milliseconds for p in solved], [p.needed.mean() for p in solved], **style)
    style_axes(left, grid="both", ylabel="scenes solved at 0.5 cm [%]")
    style_axes(right, grid="both", ylabel="pushes in these scenes, mean")
    left.set_ylim(0, 103)
    right.set_ylim(bottom=3.5)
    for axes in (left, right):
        _log_time(axes)
    picture.supxlabel("processor time of a plan [ms]", fontsize=TEXT)
    picture.legend(frameon=False, ncols=4, loc="outside upper center", fontsize=TEXT - 0.5)
    return picture


def _log_time(axes: Axes) -> None:
    axes.set_xscale("log")
    low, high = axes.get_xlim()
    axes.set_xticks([tick for tick in TICKS if low <= tick <= high])
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(NullFormatter())
