"""Which files hold real pushes, and the bodies that were pushed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self

import numpy as np

from sain_core.errors import ConfigError, DatasetError
from sain_core.shapes.library import get_shape
from sain_core.shapes.outlines import BodyOutline, StatedBodies, read_stated
from sain_core.types import Mask
from sain_model.importing.csv_files import read_csv
from sain_model.importing.pose_bags import METADATA, PoseTopics, read_pose_bag
from sain_model.importing.pose_bags import SUFFIXES as BAGS
from sain_model.importing.real_pushes import (
    FOUND_AT,
    PUBLISHED_TIP_RADIUS,
    RealPushes,
    check_real,
    is_published,
    joined,
    read_logs,
    read_npz,
)

NPZ, MAT, CSV = FORMS = (".npz", ".mat", ".csv")
SUFFIXES: Final = (*FORMS, *BAGS)
# Where outlines stand if no file is named, in upper or lower case.
BESIDE: Final = ("shapes.json", "shapes.yaml", "outlines.yaml")
MOST_FILES: Final = 10_000
MOST_NAMED: Final = 5  # files that are left out
PACKED: Final = (".gz", ".bz2", ".xz", ".zip", ".zst")

BodyKey = tuple[str, float]  # name, and the radius [m] that a row states; NaN: none


@dataclass(frozen=True)
class Recordings:
    """What was read."""

    pushes: RealPushes  # of all files
    bodies: dict[BodyKey, BodyOutline]  # by name and stated radius of each row's body
    keys: list[BodyKey]  # of each row
    notes: tuple[str, ...]  # lines about what was left out or turned round
    paths: tuple[Path, ...]  # the files

    def select(self, rows: Mask) -> Self:
        """Return some of the pushes."""
        keys = [self.keys[row] for row in np.flatnonzero(rows)]
        return replace(self, pushes=self.pushes.select(rows), keys=keys)


def read_recordings(
    paths: Sequence[Path],
    shapes: Path | None = None,
    tip_radius: float | None = None,
    degrees: bool = False,
    topics: PoseTopics | None = None,
) -> Recordings:
    """Read files and folders of real pushes; of bags, poses of these topics.

    Without a file of outlines, one of `BESIDE` next to the first path is read, if any. Where
    neither rows nor that file state the tool's radius [m], it is that of the laboratory that
    published the form. `degrees` as in `read_csv`.

    Raises `DatasetError`: nothing there, a file that is damaged or of another form, a number that
    cannot be, a body without an outline, or a tool without a radius.
    """
    found, notes = _find(paths)
    shapes = shapes or _outlines_beside(paths[0])
    stated = read_stated(shapes) if shapes else StatedBodies({})
    tip_radius = stated.tip_radius if tip_radius is None else tip_radius
    published = PUBLISHED_TIP_RADIUS if tip_radius is None else tip_radius
    logs = [path for path in found if form_of(path) == MAT]
    read = dict(zip(logs, read_logs(logs, published), strict=True))
    for path in found:
        if form_of(path) == NPZ:
            read[path] = read_npz(path, published)
        elif form_of(path) == CSV:
            read[path], of_file = read_csv(path, degrees)
            notes += of_file
        elif form_of(path) in BAGS:
            read[path], of_file = read_pose_bag(path, topics)
            notes += of_file
    pushes = joined([read[path] for path in found])
    if (same := pushes.same_as_before()).any():
        notes.append(f"{same.sum():,} rows state a push of another row once more: left out")
        pushes = pushes.select(~same)
    if (unknown := np.isnan(pushes.tip_radius)).any():
        if tip_radius is None:
            raise DatasetError(
                f"{pushes.where(int(np.argmax(unknown)))} does not state the radius of the tool;"
                " give --tip-radius or a column tip_radius"
            )
        pushes.tip_radius[unknown] = tip_radius
    pushes = check_real(pushes)
    bodies, keys = _bodies(pushes, stated, shapes)
    notes += [
        f"the outline of {name!r}: {note}"
        for (name, _), body in bodies.items()
        for note in body.mended
    ]
    return Recordings(pushes, bodies, keys, tuple(notes), tuple(found))


def _outlines_beside(path: Path) -> Path | None:
    """Return the file of outlines in the same folder, if there is one."""
    folder = path if path.is_dir() else path.parent
    beside = [file for file in sorted(folder.iterdir()) if file.name.lower() in BESIDE]
    if len(beside) > 1:
        names = " and ".join(map(str, beside))
        raise DatasetError(f"{names} both state outlines; name one of them (--shapes)")
    return next(iter(beside), None)


def form_of(path: Path) -> str:
    """Return the suffix of a file, in lower case; "": a folder.

    Of a folder that is one bag of ROS 2, it is the suffix of the files inside.
    """
    if not path.is_dir():
        return path.suffix.lower()
    is_bag = (path / METADATA).is_file()
    names = [one.name for one in path.iterdir()] if is_bag else []  # some have .zstd behind it
    return next((suffix for suffix in BAGS if any(suffix in name for name in names)), "")


def files_of(path: Path) -> list[Path]:
    """Return a file, or all files of a bag's folder, in order."""
    return sorted(filter(Path.is_file, path.iterdir())) if path.is_dir() else [path]


def _find(paths: Sequence[Path]) -> tuple[list[Path], list[str]]:
    """Return the files, and notes about those of a folder that are of another form."""
    found, notes = list[Path](), list[str]()
    if not paths:
        raise DatasetError("give one or more files of pushes, or folders of them")
    for path in paths:
        if not path.exists():
            raise DatasetError(f"{path} does not exist; {FOUND_AT}")
        if form_of(path) or not path.is_dir():
            if form_of(path) not in SUFFIXES:
                packed = "unpack it first; " if form_of(path) in PACKED else ""
                raise DatasetError(
                    f"{path} is no file of pushes; {packed}allowed: {', '.join(SUFFIXES)}"
                )
            found.append(path)
            continue
        inside = [file for file in sorted(path.iterdir()) if file.name.lower() not in BESIDE]
        pushes = [file for file in inside if form_of(file) in SUFFIXES]
        found += (own := [one for one in pushes if form_of(one) != NPZ or is_published(one)])
        if not pushes:
            raise DatasetError(f"{path} holds no {', '.join(SUFFIXES)}; {FOUND_AT}")
        if others := [file.name for file in inside if file not in own]:
            names = ", ".join(others[:MOST_NAMED]) + (", ..." * (len(others) > MOST_NAMED))
            notes.append(f"{len(others)} of {path} are of another form, and left out: {names}")
    if not 0 < len(found) <= MOST_FILES:
        raise DatasetError(f"{len(found)} files of pushes were found; allowed: 1 to {MOST_FILES}")
    return found, notes


def _bodies(
    pushes: RealPushes, stated: StatedBodies, shapes: Path | None
) -> tuple[dict[BodyKey, BodyOutline], list[BodyKey]]:
    """Return the bodies of the rows: stated ones, or shapes of the library with a radius."""
    bodies: dict[BodyKey, BodyOutline] = {}
    keys = []
    pairs = zip(pushes.object.tolist(), np.nan_to_num(pushes.radius).tolist(), strict=True)
    for index, (name, radius) in enumerate(pairs):
        key = (name, 0.0 if name in stated.bodies else radius)
        keys.append(key)
        if key not in bodies:
            where = f"{shapes} states no" if shapes else "no file (--shapes) states an"
            missing = f"{pushes.where(index)}: {where} outline of {name!r}"
            bodies[key] = stated.bodies.get(name) or _of_library(name, radius, missing)
    return bodies, keys


def _of_library(name: str, radius: float, missing: str) -> BodyOutline:
    """Return a shape of the library with a circumscribed radius [m]; 0: it is not stated."""
    try:
        shape = get_shape(name)
    except ConfigError as error:
        raise DatasetError(f"{missing}, and it is no shape of the library") from error
    if not radius:
        raise DatasetError(
            f"{missing}; for the shape of the library give its circumscribed radius [m] in the"
            " column radius"
        )
    return BodyOutline(shape, radius / shape.circumradius, (0.0, 0.0))
