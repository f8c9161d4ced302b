"""Errors as tables, for the terminal and in Markdown, and the picture of rollouts."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sain_core.cli.terminal import FittingTable, make_table, markdown_table
from sain_core.randomness import Interval, bootstrap_mean, generator
from sain_core.scene import MID, TARGET
from sain_core.view.figures import TEXT, new_figure, style_axes, write_png
from sain_core.view.palette import PALETTE
from sain_model.evaluation.errors import (
    DEG,
    ENOUGH,
    HISTORY,
    LEARNED,
    MEASURED,
    MM,
    PRIOR,
    PRIOR_HISTORY,
    PUSHED,
    RECURRENT_SAIN,
    SAIN,
    TARGET_MISSED,
    TARGET_MOVED,
    TARGETS,
    Figures,
    Predictions,
    position_errors,
)

ROLLED: Final = (TARGETS, TARGET_MOVED, TARGET_MISSED, f"target, {ENOUGH}+ earlier", PUSHED)
PREDICTION: Final = ("prediction", "number", "mean", "95 %", "median", "p95")
PARTS: Final = {
    TARGETS: "the target's error after one push in mm, all pushes",
    TARGET_MOVED: "the target's error after one push in mm, pushes that moved it",
    PUSHED: "the pushed body's error after one push in mm",
}


def error_tables(found: Figures) -> Iterator[FittingTable]:
    """Yield what `errors.evaluate` returns of single pushes as tables."""
    once = found["after"]["1"]
    errors, ratios = once["errors"], once["ratios"]
    for group, title in PARTS.items():
        if group in errors:
            rows = ((name, *_cells(one)) for name, one in errors[group].items())
            yield make_table(title, PREDICTION, rows)
    if pair := _beside_its_prior(ratios):
        yield _group_table(errors, ratios, *pair)


def _cells(one: Figures) -> list[str]:
    mean, low, high = one[MM]
    values = mean, one["median"], one["p95"]
    cells = [f"{value:.2f}" for value in values]
    within = f"{low:.2f}-{high:.2f}" if high > low else "-"  # one episode has no spread
    return [str(one["number"]), cells[0], within, *cells[1:]]


def _beside_its_prior(ratios: Figures) -> tuple[str, str] | None:
    """Return the model that is compared with its own prior, with history where both have it."""
    for prior, end in ((PRIOR_HISTORY, HISTORY), (PRIOR, "")):
        for by_name in ratios.values():
            for name, below in by_name.items():
                if prior in below and name.endswith(end):
                    return name, prior
    return None


def _group_table(errors: Figures, ratios: Figures, main: str, prior: str) -> FittingTable:
    """Return the errors of a model and of its prior with the same history, by group."""
    header = ["bodies", "number"]
    header += [f"{name} {unit}" for unit in (MM, DEG) for name in ("prior", main, "ratio")]
    rows = []
    for group, by_name in errors.items():
        ratio = ratios[group].get(main, {}).get(prior)
        if ratio is None:
            continue
        cells = [group, str(by_name[main]["number"])]
        for unit in (MM, DEG):
            cells += [f"{by_name[name][unit][0]:.2f}" for name in (prior, main)]
            cells.append("{:.2f} {:.2f}-{:.2f}".format(*ratio[unit]) if unit in ratio else "")
        held = by_name[main].get("coverage")
        rows.append([*cells, f"{100 * held[0]:.0f}" if held else ""])
    return make_table("Errors after one push, by bodies", [*header, "coverage %"], rows)


def rollout_markdown(found: Figures) -> str:
    """Return the errors after each number of pushes, positions in mm, headings in degrees."""
    parts = []
    header = ["prediction", "number", "mean", "median", "p95", "heading", "contacts agreed"]
    for step, after in found["after"].items():
        pushes = "1 push" if step == "1" else f"{step} pushes"
        for group in (group for group in ROLLED if group in after["errors"]):
            rows = [_rolled(name, one) for name, one in after["errors"][group].items()]
            parts.append(f"### After {pushes}, {group}\n\n{markdown_table(header, rows)}\n")
            parts += _ratio_lines(after["ratios"][group])
    return "".join(parts)


def _rolled(name: str, one: Figures) -> list[str]:
    return [
        name,
        str(one["number"]),
        "{:.2f} [{:.2f}, {:.2f}]".format(*one[MM]),
        f"{one['median']:.2f}",
        f"{one['p95']:.2f}",
        f"{one[DEG][0]:.1f}",
        f"{100 * one['agreed']:.0f} %",
    ]


def _ratio_lines(ratios: dict[str, Any]) -> Iterator[str]:
    """Yield the ratios of mean errors of models, as a list."""
    for name, below in ratios.items():
        for under, units in below.items():
            if MM in units:
                yield "* {} / {}: {:.2f} [{:.2f}, {:.2f}]\n".format(name, under, *units[MM])
    if ratios:
        yield "\n"


KINDS: Final = {  # the four of the paper's Fig. 1, with their colours
    MEASURED: ("physics only", PALETTE.physics),
    LEARNED: (LEARNED, PALETTE.learned),
    SAIN: ("residual SAIN", PALETTE.predicted),
    RECURRENT_SAIN: ("recurrent SAIN", PALETTE.history),
}
NEAREST: Final = 0.07  # of the axis' height, between two labels


def save_rollout_plot(path: Path, predictions: Sequence[Predictions], seed: int) -> None:
    """Write a PNG of mean errors over steps with 95 % bands, of scenes with a target.

    All steps are of the same windows: those of the full length, or of the longest there is.
    """
    shown = [one for one in predictions if one.part.disks > TARGET]
    if shown:
        write_png(draw_rollouts(shown, seed), path)


def draw_rollouts(predictions: Sequence[Predictions], seed: int) -> Figure:
    """Draw the errors after each step of the longest windows."""
    lengths = [one.windows.known.sum(axis=1) for one in predictions]
    steps = max(int(length.max()) for length in lengths)
    masks = [length == steps for length in lengths]
    figure = new_figure(6.6, 6.6)
    panels = figure.subplots(2, 1, sharex=True)
    for axes, body, title in zip(panels, (TARGET, MID), ("target", "body 0"), strict=True):
        style_axes(axes, title, ylabel="mean position error [mm]")
        curves = {
            label: (_curve(predictions, masks, name, steps, body, seed), colour)
            for name, (label, colour) in KINDS.items()
            if all(name in one.by_name for one in predictions)
        }
        _draw(axes, curves, steps)
    panels[1].set_xlabel("pushes predicted from the first scene alone", fontsize=TEXT)
    episodes = [one.windows.episodes[rows] for one, rows in zip(predictions, masks, strict=True)]
    joined = np.concatenate(episodes)
    count = f"{len(joined)} rollouts of {steps} pushes, {len(np.unique(joined))} held-out episodes"
    figure.suptitle(f"{count}; bands: 95 %", x=0.02, ha="left", fontsize=TEXT + 1.5)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, frameon=False, loc="outside lower center", ncols=4, fontsize=TEXT
    )
    return figure


def _draw(axes: Axes, curves: dict[str, tuple[list[Interval], str]], steps: int) -> None:
    ends = []
    places = np.arange(1, steps + 1)
    for label, (curve, colour) in curves.items():
        mean, low, high = np.array(curve).T
        axes.plot(places, mean, color=colour, linewidth=2.2, label=label)
        axes.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        ends.append((float(mean[-1]), colour))
    axes.set_xlim(1, 1 + 1.1 * max(steps - 1, 1))
    axes.set_ylim(bottom=0)
    axes.set_xticks([1, *range(5, steps + 1, 5)])
    apart, above = NEAREST * axes.get_ylim()[1], -np.inf
    for value, colour in sorted(ends):  # each curve's value at its end, labels kept apart
        above = max(value, above + apart)
        style: dict[str, Any] = {"color": colour, "va": "center", "fontsize": TEXT}
        axes.annotate(
            f"{value:.0f} mm", (steps, above), (6, 0), textcoords="offset points", **style
        )


def _curve(
    predictions: Sequence[Predictions],
    masks: Sequence[np.ndarray],
    name: str,
    steps: int,
    body: int,
    seed: int,
) -> list[Interval]:
    curve, shown = [], list(zip(predictions, masks, strict=True))
    episodes = np.concatenate([one.windows.episodes[rows] for one, rows in shown])
    for step in range(steps):
        errors = [
            position_errors(
                one.by_name[name][rows, step], one.windows.next_scenes[rows, step], body
            )
            for one, rows in shown
        ]
        random = generator(seed, "bootstrap")
        curve.append(bootstrap_mean(np.concatenate(errors), random, episodes))
    return curve
