"""docs/reference/real.md, from the file of results: no number of it is written by hand."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from benchmarks.real.measures import Figures
from benchmarks.real.rows import STATED
from benchmarks.report import markdown_table

OURS: Final = ("sain", "identified", "learned")  # rows of the sentence above the first table
SOURCE: Final = (
    "The data are the public MCube push data set: Yu, Bauza, Fazeli and Rodriguez, *More than a"
    " million ways to be pushed*, IROS 2016. Zhou et al. published them in the one-push form:"
    " repository `robinzhoucmu/PlanarManipulationToolBox`, folder"
    " `mcube_data_proc/motion_model_eval_logs`, licence GPL-2. This repository has none of it."
)
OWN: Final = "The data are recordings of your own."
ABOUT: Final = """# Real pushes

For users who own a robot: how well models predict pushes of real objects that a real robot made.
`make real DATA=PATH` writes this page.

<!-- not tested: needs the data, and an hour -->
```
make real DATA=~/data/mit_push     # about an hour on two cores; an interrupted run continues
```
"""
HOW: Final = """## How it is measured

* **Errors**: mean distance of the predicted from the measured place, and mean absolute error of the
  heading, over all predicted pushes. Brackets are 95 % intervals by bootstrap over groups of near
  repeats.
* **Near repeats** are in one fold: no model learned from a repeat of a push that it predicts.
* **Own pushes** are pushes of the same object on the same surface. All cases with an object left
  out predict the same pushes, whatever the number of own pushes. With a surface left out, models
  have learned from the same pushes on the other surface.
* **Physics, nominal** has textbook values and no measurement of the object. **Physics, identified**
  has parameters of each object on its surface, with a prior from the other objects.
* **SAIN, as shipped** is the model of this package, which learned from simulated pushes alone.
  **Its physics, as shipped** is the same model without its network. Both have no earlier push.
* **SAIN** on an object that was left out is conditioned on the own pushes, as in use. Its network
  counts for a new object only where it explains them better than the physics does.
* **Limit surfaces** are predictions that Zhou et al. published with the data. Their models were
  fitted to measured forces.
* **Regions** of a model follow the errors on an object: of pushes that were held back from the
  training, or of the own pushes.
* **Learned only** is the network of SAIN without physics.
* **Trees** are extremely randomised trees of scikit-learn on the geometry of the contact, and on
  the prediction of a physics. They are no part of SAIN.
"""


def page(results: Figures) -> str:
    """Return the page in Markdown."""
    parts = [
        ABOUT,
        _data(results),
        *_result(results),
        *_noise(results),
        *_training(results),
        *_left_out(results),
        *_regions(results),
        HOW,
        _provenance(results),
    ]
    return "\n".join(part.strip() + "\n" for part in parts if part)


def _data(results: Figures) -> str:
    data = results["data"]
    speeds = " and ".join(f"{1e3 * speed:g}" for speed in data["speeds"])
    return (
        f"{SOURCE if data['published'] else OWN}\n\n"
        f"{data['pushes']:,} pushes of {len(data['objects'])} objects on"
        f" {len(data['surfaces'])} surface{'s'[: len(data['surfaces']) > 1]}"
        f" ({', '.join(data['surfaces'])}) at {speeds} mm/s. {data['missed']:,} of them touch"
        f" nothing. They are {data['groups']:,} groups of near repeats."
    )


def with_interval(values: Sequence[float], digits: int) -> str:
    """Return a mean with its interval."""
    mean, low, high = (f"{value:.{digits}f}" for value in values)
    return f"{mean} [{low}, {high}]"


def _errors(results: Figures, case: Figures) -> str:
    rows = [
        (
            title,
            with_interval(case["errors"][key]["mm"], 2),
            with_interval(case["errors"][key]["degrees"], 1),
            f"{case['errors'][key]['median_mm']:.2f}",
            f"{case['errors'][key]['p90_mm']:.2f}",
        )
        for key, title in results["rows"].items()
    ]
    header = ("model", "position [mm]", "heading [degrees]", "median [mm]", "90 % below [mm]")
    return markdown_table(header, rows)


def best(results: Figures, case: Figures) -> str:
    """Return the key of the row with the smallest error of the position."""
    return min(results["rows"], key=lambda key: case["errors"][key]["mm"][0])


def said(results: Figures, case: Figures, key: str) -> str:
    """Return a row and its errors as a phrase."""
    mm, degrees = (case["errors"][key][unit][0] for unit in ("mm", "degrees"))
    return f"{results['rows'][key]}: {mm:.2f} mm and {degrees:.1f} degrees"


def _result(results: Figures) -> Iterator[str]:
    case = results["cases"]["folds"]
    yield f"## {case['title'].capitalize()}"
    ours = [said(results, case, key) for key in OURS if key in case["errors"]]
    yield f"Mean errors of {case['pushes']:,} pushes:\n\n" + "".join(f"* {one}\n" for one in ours)
    yield f"The most accurate model is {said(results, case, best(results, case))}."
    yield _errors(results, case)


def _noise(results: Figures) -> Iterator[str]:
    noise = results["noise"]
    yield "## Noise"
    if not noise["pairs"]:
        yield "The data have no near repeats of a push on one surface, so noise is not known."
        return
    yield (
        f"{noise['pairs']:,} pairs of near repeats of one object on one surface show what no model"
        f" can predict: {with_interval(noise['mm'], 2)} mm and"
        f" {with_interval(noise['degrees'], 1)} degrees. That is the mean difference of two repeats"
        " over the square root of 2. The table has the share of noise in the squared errors of the"
        " same pushes."
    )
    rows = [
        (title, *(f"{100 * share:.0f} %" for share in noise["share"][key]))
        for key, title in results["rows"].items()
    ]
    yield markdown_table(("model", "noise in position", "noise in heading"), rows)


def _training(results: Figures) -> Iterator[str]:
    sizes = [key for key in results["cases"] if key.startswith("train_")]
    if not sizes:
        return
    yield "## By number of training pushes"
    yield "Five folds; position [mm] and heading [degrees]."
    yield _by_case(results, [*sizes, "folds"], ["all"])


def _by_case(results: Figures, keys: Sequence[str], last: Sequence[str] = ()) -> str:
    """Return a table with a column for each case, named by the number in its key."""
    names = [key.partition("_")[2] for key in keys[: len(keys) - len(last)]] + list(last)
    rows = [
        (title, *(_pair(results["cases"][key]["errors"].get(row)) for key in keys))
        for row, title in results["rows"].items()
    ]
    return markdown_table(("model", *(f"{int(n):,}" if n.isdigit() else n for n in names)), rows)


def _pair(errors: Figures | None) -> str:
    if errors is None:
        return ""
    return f"{errors['mm'][0]:.2f}, {errors['degrees'][0]:.1f}"


def _left_out(results: Figures) -> Iterator[str]:
    if counts := sorted(int(k[7:]) for k in results["cases"] if k.startswith("object_")):
        yield "## An object left out"
        case = results["cases"][f"object_{counts[0]}"]
        yield (
            f"Each object is predicted by models of the other objects and of some own pushes:"
            f" {case['pushes']:,} pushes; position [mm] and heading [degrees] by own pushes."
        )
        yield _by_case(results, [f"object_{count}" for count in counts])
        if "object_20" in results["cases"]:
            yield "With intervals, 20 own pushes of each body:"
            yield _errors(results, results["cases"]["object_20"])
    for key, case in results["cases"].items():
        if key.startswith("surface_"):
            title = case["title"].capitalize()
            yield f"## {title}" if key == "surface_0" else f"{title}:"
            yield _errors(results, case)


def _regions(results: Figures) -> Iterator[str]:
    cases = {key: case for key, case in results["cases"].items() if case["regions"]}
    if not cases:
        return
    yield "## Regions"
    yield (
        f"Regions of {100 * STATED:.0f} %: how many pushes they hold, in all and for the objects"
        " with the fewest and the most, and their mean size."
    )
    rows = [
        (
            f"{results['rows'][key]}, {case['title']}",
            *_held(found["mm"]),
            *_held(found["degrees"]),
        )
        for case in cases.values()
        for key, found in case["regions"].items()
    ]
    sizes = ("position", "by object", "mm", "heading", "by object", "degrees")
    yield markdown_table(("model and case", *sizes), rows)


def _held(found: Mapping[str, Any]) -> list[str]:
    of = found["by_object"].values()
    return [
        f"{100 * found['held']:.1f} %",
        f"{100 * min(of):.0f} to {100 * max(of):.0f} %",
        f"{found['size']:.1f}",
    ]


def _provenance(results: Figures) -> str:
    made = results["made"]
    minutes = sum(results["seconds"].values()) / 60
    return (
        f"`{made['command']}`, commit {made['commit'][:9]}, on {made['processor']}."
        f" {minutes:.0f} minutes of computing. The seed of folds, own pushes, training and"
        f" bootstrap is {made['seed']}. The data have SHA-256 {results['data']['sha256'][:12]}."
    )
