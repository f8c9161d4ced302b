"""A few pushes of the project's own simulation, written in the forms that laboratories use."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy import ndarray
from scipy.io import savemat

from sain_core.push import make_stroke
from sain_core.scene import MASS, POSITION, RADIUS, THETA, unit
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import StatedBodies, read_stated
from sain_model.inference.kinds import surface_kind
from sain_model.physics.planar import PlanarPrior, first_touch

TIP = 0.00475
KNEE = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.04], [0.04, 0.04], [0.04, 0.12], [0.0, 0.12]]
STATED = {"shapes": {"knee": KNEE, "oval": {"semi_axes": [0.05, 0.08]}}}
PUSHES = 12  # of each body


@dataclass(frozen=True, eq=False)
class Recorded:
    """M pushes, as a laboratory has them: poses are of the frame that outlines are stated in."""

    surface: ndarray
    object: ndarray
    speed: ndarray
    before: ndarray
    after: ndarray
    tip_start: ndarray
    tip_end: ndarray

    def __len__(self) -> int:
        return len(self.speed)

    def changed(self, **columns: ndarray) -> "Recorded":
        return replace(self, **columns)


def write_stated(folder: Path, stated: object = STATED) -> Path:
    """Write outlines beside recordings; return the file."""
    path = folder / "shapes.json"
    path.write_text(json.dumps(stated))
    return path


def simulate(folder: Path) -> Recorded:
    """Push both bodies in simulation: from all around, some past them, every third one twice."""
    stated: StatedBodies = read_stated(write_stated(folder))
    random, parts = np.random.default_rng(0), []
    for name, body in stated.bodies.items():
        before = random.uniform((0.3, -0.1, -3.0), (0.4, 0.1, 3.0), (PUSHES, 3))
        bearing = random.uniform(-3.0, 3.0, PUSHES)
        centre = before[:, :2] + turned(before[:, 2], np.array(body.centre))
        start = centre + 0.11 * unit(bearing)
        heading = bearing + np.pi + random.uniform(-0.7, 0.7, PUSHES)
        end = start + 0.06 * unit(heading)
        again = np.arange(PUSHES) % 3 == 1  # a repeat of the one before, elsewhere on the table
        for row in np.flatnonzero(again):
            spin = random.uniform(-3.0, 3.0)
            about = before[row - 1, :2]
            before[row, 2] = before[row - 1, 2] + spin
            for place in (start, end):
                place[row] = before[row, :2] + turned(spin, place[row - 1] - about)
        states = np.zeros((PUSHES, 1, 8))
        states[:, 0, POSITION] = before[:, :2] + turned(before[:, 2], np.array(body.centre))
        states[:, 0, THETA], states[:, 0, MASS] = before[:, 2], 1.0
        states[:, 0, RADIUS] = body.radius
        way = end - start
        strokes = make_stroke(
            start, np.arctan2(way[:, 1], way[:, 0]), np.hypot(*way.T), speed=0.02, tip_radius=TIP
        )
        bodies = Bodies((body.shape.on("flat"),))
        assert not first_touch(states, strokes, bodies).inside.any()
        settled = PlanarPrior(surface_kind().config, bodies).step(states, strokes)[:, 0]
        after = np.column_stack(
            [
                settled[:, POSITION] - turned(settled[:, THETA], np.array(body.centre)),
                settled[:, THETA],
            ]
        )
        surface = np.where(again, "steel", "wood")
        parts.append(
            (surface, np.full(PUSHES, name), np.full(PUSHES, 0.02), before, after, start, end)
        )
    return Recorded(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def turned(angle: ndarray | float, vectors: ndarray) -> ndarray:
    """Return vectors (..., 2) turned by an angle (...,) [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def write_npz(path: Path, rows: Recorded) -> Path:
    np.savez(
        path,
        surface=rows.surface,
        shape=rows.object,
        speed=rows.speed,
        init_pose=rows.before,
        final_pose=rows.after,
        tip_init=rows.tip_start,
        tip_final=rows.tip_end,
    )
    return path


def write_mats(folder: Path, rows: Recorded, models: tuple[str, ...] = ("poly4",)) -> Path:
    """Write a log for each surface and body, as often as there are models."""
    folder.mkdir(exist_ok=True)
    for surface in np.unique(rows.surface):
        for name in np.unique(rows.object):
            chosen = np.flatnonzero((rows.surface == surface) & (rows.object == name))
            records = np.empty((len(chosen), 1), dtype=object)
            for place, row in enumerate(chosen):
                records[place, 0] = {
                    "init_pose_gt": rows.before[row][:, None],
                    "final_pose_gt": rows.after[row][:, None],
                    "init_tip_pt": rows.tip_start[row][:, None],
                    "final_tip_pt": rows.tip_end[row][:, None],
                }
            log = {
                "surface_type": str(surface),
                "shape_id": str(name),
                "vel": 1e3 * rows.speed[chosen[0]],
                "record_all": records,
            }
            for model in models:
                savemat(folder / f"{surface}_{name}_{model}_v20.mat", log, do_compression=True)
    return folder


HEADER = "surface,object,x0,y0,theta0,x1,y1,theta1,tip_x0,tip_y0,tip_x1,tip_y1,speed,tip_radius"


def write_csv(path: Path, rows: Recorded, header: str = HEADER) -> Path:
    numbers = np.column_stack(
        [rows.before, rows.after, rows.tip_start, rows.tip_end, rows.speed, np.full(len(rows), TIP)]
    )
    lines = [
        ",".join([surface, name, *map(repr, row)])
        for surface, name, row in zip(rows.surface, rows.object, numbers.tolist(), strict=True)
    ]
    path.write_text("\n".join([header, *lines]) + "\n")
    return path
