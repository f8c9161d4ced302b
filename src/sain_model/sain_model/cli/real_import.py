"""``ros2 run sain_model real_import``: a real robot's pushes as a data set."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import tyro
from rich.console import Console

from sain_core.config import Config, option, required
from sain_core.errors import OutputError
from sain_core.guarding.documents import parse_json
from sain_core.guarding.untrusted import read_regular_text
from sain_core.output import OVERWRITE_HELP, claim_folder
from sain_core.shapes.outlines import LEAST_MASS, MOST_MASS
from sain_core.storage import hash_files
from sain_core.transitions import Column
from sain_model.network.settings import MASS_MIDDLE

if TYPE_CHECKING:
    from sain_model.importing.data_set import Imported
    from sain_model.importing.files import Recordings

MILLIMETRES: Final = 1e3


@dataclass(frozen=True)
class RealImportOptions(Config):
    """Make a data set of a real robot's pushes: .csv with a header, bags, published .npz or .mat.

    docs/guides/real_pushes.md shows the columns. Pushes that nearly repeat each other become one
    episode, so that no split divides them.
    """

    paths: Annotated[tuple[Path, ...], tyro.conf.Positional] = required(
        "files of pushes, or folders of them"
    )
    out: Path = required("new folder for the data set")
    overwrite: bool = option(False, OVERWRITE_HELP)
    shapes: Path | None = option(
        None,
        "JSON or YAML file of the outlines [m]; by default shapes.json, shapes.yaml or"
        " outlines.yaml beside the first path",
    )
    tip_radius: float | None = option(
        None, "radius of the tool where rows state none", unit="m", minimum=0.001, maximum=0.05
    )
    body_topic: str = option(
        "", "of bags: topic of the body's poses; of transforms, as /tf:FRAME of its frame"
    )
    tool_topic: str = option("", "of bags: topic of the tool's poses, likewise")
    body: str = option("", "of bags: name of the body's outline")
    surface: str = option("", "of bags: what the body stands on")
    degrees: bool = option(
        False, "headings of .csv files are in degrees, where their header states no unit"
    )
    mass: float = option(
        MASS_MIDDLE,
        "nominal mass where rows state none: slow pushes do not depend on it",
        unit="kg",
        minimum=LEAST_MASS,
        maximum=MOST_MASS,
    )
    skip_bad: bool = option(
        True,
        "leave out pushes that cannot be: a tool inside the body, or a body that moves untouched or"
        " farther than the tool; else they are an error",
    )


def run(options: RealImportOptions, console: Console) -> None:
    """Import, print what became of the pushes, and write the data set."""
    from sain_core.cli.terminal import WaitingLine
    from sain_model.importing.data_set import WRITTEN, import_pushes, write_imported
    from sain_model.importing.files import read_recordings
    from sain_model.importing.pose_bags import PoseTopics

    claim_folder(options.out, WRITTEN, options.overwrite)
    about = options.body_topic, options.tool_topic, options.body
    topics = PoseTopics(*about, options.surface) if all(about) else None
    found = read_recordings(
        options.paths, options.shapes, options.tip_radius, options.degrees, topics
    )
    for note in found.notes:  # they may be why the import fails
        console.print(note, soft_wrap=True, markup=False, highlight=False)
    card = _card(options, found)
    if not options.overwrite:
        _check_same(options.out, card)
    with WaitingLine(Console(stderr=True)) as line:

        def progress(done: int, total: int) -> None:
            line.say(f"physics of {done:,} of {total:,} pushes")

        made = import_pushes(found, options.mass, options.skip_bad, progress)
    shards = write_imported(options.out, made, card)
    for text in _report(found, made):
        console.print(text, soft_wrap=True, markup=False, highlight=False)
    rows = f"{len(made.columns[Column.STATE]):,} pushes in {shards} files"
    console.print(f"written to {options.out}: {rows}", soft_wrap=True, highlight=False)


def _check_same(out: Path, card: dict[str, Any]) -> None:
    """Raise `OutputError` where a folder holds another data set than this import."""
    from sain_model.importing.data_set import CARD_FILE, SHARD_PATTERN

    if not any(out.glob(SHARD_PATTERN)):
        return
    path = out / CARD_FILE
    there = parse_json(read_regular_text(path)) if path.exists() else {}
    differ = [name for name, value in card.items() if there.get(name) != value]
    if differ:
        raise OutputError(
            f"{out} holds another data set (its {CARD_FILE} differs in {differ[0]});"
            " choose another folder, or --overwrite"
        )


def _card(options: RealImportOptions, found: "Recordings") -> dict[str, Any]:
    from sain_model.importing.files import files_of

    stated = ~np.isnan(found.pushes.mass)
    return {
        "kind": "pushes of a real robot",
        "sources": [
            {"path": str(path), "sha256": hash_files(files_of(path))} for path in found.paths
        ],
        "notes": list(found.notes),
        "mass": "as stated" if stated.all() else f"nominal where not stated: {options.mass} kg",
    }


def _report(found: "Recordings", made: "Imported") -> Iterator[str]:
    """Yield lines about what was left out and grouped."""
    from sain_model.importing.data_set import MANY_MISSES, REMEDY, UNTOUCHED, summary_of

    pushes, about = found.pushes, summary_of(made)
    surfaces = Counter(sorted(pushes.surface.tolist()))
    on = ", ".join(f"{name or 'not stated'} {n:,}" for name, n in surfaces.items())
    yield f"{len(pushes):,} pushes of {len(set(pushes.object.tolist()))} bodies; surfaces: {on}"
    if two := pushes.span.any(axis=1).sum():
        bars = pushes.bar.sum()
        yield f"{two - bars:,} are with two fingers, {bars:,} with a bar"
    for what, one in about["left_out"].items():
        more = ", ..." * (one["pushes"] > len(one["rows"]))
        yield f"{one['pushes']:,} left out: {what} ({', '.join(one['rows'])}{more})"
    count, misses = about["transitions"], about["misses"]
    if misses > MANY_MISSES * count:
        yield f"warning: {misses:,} of {count:,} never touch the body; {REMEDY}"
    yield (
        f"{misses:,} never touch the body; {about['groups_of_repeats']:,} groups of repeats,"
        f" {100 * about['share_with_repeat']:.0f} % of pushes have one, at most"
        f" {about['largest_group']} in a group"
    )
    state, after, physics = (
        made.columns[name].reshape(count, -1)[:, :2]
        for name in (Column.STATE, Column.NEXT_STATE, Column.PHYSICS_NEXT)
    )
    moved, off = (MILLIMETRES * np.linalg.norm(after - x, axis=1).mean() for x in (state, physics))
    if off > max(moved, MILLIMETRES * UNTOUCHED):
        yield f"warning: nominal physics errs by more than the bodies move; {REMEDY}"
    yield f"bodies moved by {moved:.2f} mm in the mean; nominal physics errs by {off:.2f} mm"
