"""Errors as tables, for the terminal and in Markdown."""

from collections.abc import Iterator
from typing import Any, Final

from sain_core.cli.terminal import FittingTable, make_table, markdown_table
from sain_model.evaluation.errors import (
    DEG,
    ENOUGH,
    MM,
    PUSHED,
    TARGET_MISSED,
    TARGET_MOVED,
    TARGETS,
    Figures,
)
from sain_model.evaluation.predictors import HISTORY, PRIOR, PRIOR_HISTORY

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
    yield from _history_table(errors)
    for name, ranks in found["rank_correlation"].items():
        yield _region_table(errors, name, ranks)


def _cells(one: Figures) -> list[str]:
    mean, low, high = one[MM]
    values = mean, one["median"], one["p95"]
    cells = [f"{value:.2f}" for value in values]
    return [str(one["number"]), cells[0], f"{low:.2f}-{high:.2f}", *cells[1:]]


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
        if ratio is None or " by " in group:
            continue
        cells = [group, str(by_name[main]["number"])]
        for unit in (MM, DEG):
            cells += [f"{by_name[name][unit][0]:.2f}" for name in (prior, main)]
            cells.append("{:.2f} {:.2f}-{:.2f}".format(*ratio[unit]) if unit in ratio else "")
        held = by_name[main].get("coverage")
        rows.append([*cells, f"{100 * held[0]:.0f}" if held else ""])
    return make_table("Errors after one push, by bodies", [*header, "coverage %"], rows)


def _history_table(errors: Figures) -> Iterator[FittingTable]:
    """Yield the mean target errors by the number of earlier pushes of the episode."""
    groups = {name: one for name, one in errors.items() if name.endswith(" earlier")}
    if not groups:
        return
    names = dict.fromkeys(name for one in groups.values() for name in one)
    counts = [group.removeprefix("target, ").removesuffix(" earlier") for group in groups]
    rows = (
        (name, *(f"{one[name][MM][0]:.2f}" if name in one else "" for one in groups.values()))
        for name in names
    )
    yield make_table("the target's error [mm] by earlier pushes", ["prediction", *counts], rows)


def _region_table(errors: Figures, name: str, ranks: dict[str, float]) -> FittingTable:
    """Return how often the regions of a model hold what it predicts, by group."""
    said = ", ".join(f"{column} {rank:.2f}" for column, rank in ranks.items())
    title = f"90 % regions of {name}; rank correlation with the error: {said}"
    header = ("bodies", "number", "held [%]", "95 %", "error [mm]", "spread", "radius")
    rows = (
        (
            group,
            str(one["number"]),
            f"{100 * one['coverage'][0]:.1f}",
            f"{100 * one['coverage'][1]:.0f}-{100 * one['coverage'][2]:.0f}",
            f"{one[MM][0]:.3f}",
            f"{one['spread']:.3f}",
            f"{one['radius']:.3f}",
        )
        for group, by_name in errors.items()
        if (one := by_name.get(name)) and "coverage" in one
    )
    return make_table(title, header, rows)


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
