"""Bodies without tags: the edges of their tops in a depth image, and known outlines laid onto them.

The table's plane is known. What is as high as a body's top is top, what is higher is the arm or a
hand. The edge between top and table belongs to a body; an edge towards the arm does not, so the
rest of a body under the arm still fits. Touching bodies share an edge line: each takes what is near
to where it was last.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Final

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from sain_core.config import Config, option
from sain_core.scene import wrap_angle
from sain_core.shapes.body_file import BodyFile
from sain_vision.detection.planar_fit import turned
from sain_vision.detection.sighting import Sighting
from sain_vision.optics import CameraModel

ROUNDS: Final = 20  # of laying an outline onto edges
GATES: Final = (0.03, 0.006)  # [m], from an outline to edges that count: at first, at last
NEAR: Final = 0.005  # [m], from a place of the outline to an edge that shows it
ARM: Final = 9  # [px], about the arm, where no edge is believed
FEWEST: Final = 25  # pixels of an edge
HEADINGS: Final = 24  # tried where nothing is known
SURE: Final = 0.7  # share of an outline that must be seen where nothing is known
SPOTS: Final = 8  # parts of touching bodies that are tried
MOST_GROUPS: Final = 16  # of edges, in which a lost body is looked for
MOST_FITS: Final = 10  # of a lost body's outline
COARSE: Final = 48  # edges and marks that are compared before a fit
MOST: Final = 160  # pixels of edges that are fitted: more are not more exact, and take longer
MARKS: Final = 96  # places along an outline
LEAST: Final = 0.01  # share of the edges' pixels that must tell of each direction
TOP: Final = 0.95  # of the heights of what stands somewhere, that of its top
ANY_TURN: Final = np.pi**2 / 3  # [rad^2], variance of a heading of which nothing is known

Marks = Float[ndarray, "M 2"]  # [m], along an outline
Places = Float[ndarray, "E 2"]  # [m], of edges
Depth = Float[ndarray, "height width"]
Pose = Float[ndarray, "3"]


@dataclass(frozen=True)
class OutlineConfig(Config):
    """How outlines are found, and what of them is believed."""

    height_error: float = option(
        0.006, "largest error of a height", unit="m", minimum=0.001, maximum=0.05
    )
    edge_noise: float = option(
        0.002, "standard deviation of an edge's place", unit="m", minimum=0.0001, maximum=0.02
    )
    max_misfit: float = option(
        0.003, "root mean square distance of edges, above which a body is not published", unit="m"
    )
    least_share: float = option(
        0.4, "share of an outline that must be seen", minimum=0.1, maximum=1.0
    )


@dataclass(frozen=True, eq=False)
class _Edges:
    """Edges of tops."""

    places: Places  # (E, 2) [m]
    pixels: Float[ndarray, "E 2"]  # (E, 2)
    groups: Int[ndarray, "E"]  # (E,), the same number for those of one top, or of some that touch
    grain: float  # size of a pixel there [m]


class OutlineFinder:
    """Finds bodies by their outlines. Not for use by two threads."""

    def __init__(self, bodies: BodyFile, config: OutlineConfig) -> None:
        self._bodies, self._config = bodies, config
        self._outlines = [
            _marked(shape.outline(radius))
            for shape, radius in zip(bodies.bodies.shapes, bodies.radii, strict=True)
        ]
        self._camera: CameraModel | None = None
        self._rays = np.zeros((0, 0, 3))

    def find(
        self,
        depth: Depth,
        camera: CameraModel,
        known: Mapping[int, Sequence[Pose]],
        everywhere: bool = True,
        arm: Bool[ndarray, "height width"] | None = None,
    ) -> tuple[list[Sighting], list[str]]:
        """Return the bodies in a depth image [m], and in words why others are not among them.

        Bodies are looked for at known poses first: where they were, or should be after a push.
        The others, and those that are not found there, are looked for everywhere, which takes long,
        but no longer than `MOST_GROUPS` and `MOST_FITS` allow.
        Nothing is seen where the arm is; without its mask, that is what is higher than all tops.
        """
        points = camera.place + depth[..., None] * self._rays_of(camera)
        sightings: list[Sighting] = []
        missing: list[int] = []
        taken: list[tuple[Pose, float]] = []
        order = sorted(range(len(self._bodies.names)), key=lambda body: body not in known)
        edges = {height: self._edges(points, height, arm) for height in set(self._bodies.heights)}
        for body in order:
            seen = edges[self._bodies.heights[body]]
            found = self._place(body, seen, known.get(body, ()), taken)
            if found is None and everywhere:
                starts = self._starts(body, seen, taken)
                found = self._place(body, seen, starts, taken, SURE)
            if found is None:
                missing.append(body)
                continue
            sightings.append(found)
            radius = self._bodies.radii[body] * self._bodies.bodies.shapes[body].circumradius
            taken.append((found.pose, 0.5 * radius))
        problems = [
            f"{self._bodies.called(body)} is not seen"
            f"{self._tipped(body, points, known.get(body, ()), taken, arm)}"
            for body in missing
        ]
        groups = max(len(np.unique(one.groups)) for one in edges.values())
        if problems and everywhere and groups > MOST_GROUPS:
            problems.append(
                f"the image has {groups} candidate outlines, more than can be tried in time: only"
                f" the {MOST_GROUPS} largest were"
            )
        return sightings, problems

    def _tipped(
        self,
        body: int,
        points: Float[ndarray, "height width 3"],
        known: Sequence[Pose],
        taken: Sequence[tuple[Pose, float]],
        arm: Bool[ndarray, "height width"] | None,
    ) -> str:
        """Return in words what stands where a body was, with another height; empty: nothing does.

        Without a mask of the arm, what is higher than all tops may be the arm.
        """
        height, most = self._bodies.heights[body], 2 * self._config.height_error
        reach = self._bodies.radii[body] * self._bodies.bodies.shapes[body].circumradius + height
        heights = np.nan_to_num(points[..., 2], nan=-1.0)
        stands = (heights > most) & ~_widened(self._high(heights) if arm is None else arm)
        free = points[stands]
        for pose, least in taken:  # half of a circumradius
            free = free[np.linalg.norm(free[:, :2] - pose[:2], axis=1) > 2.5 * least]
        for pose in known:
            near = free[np.linalg.norm(free[:, :2] - pose[:2], axis=1) < reach, 2]
            top = float(np.quantile(near, TOP)) if len(near) >= FEWEST else height
            if abs(top - height) > most:
                return (
                    f"; what stands where it was is {1e3 * top:.0f} mm high, and its top"
                    f" {1e3 * height:.0f} mm: it may have tipped over; stand it up again"
                )
        return ""

    def _high(self, heights: Depth) -> Bool[ndarray, "height width"]:
        """Return what is higher than all tops: a hand has no known geometry, and hides, too."""
        return heights > max(self._bodies.heights) + 2 * self._config.height_error

    def _rays_of(self, camera: CameraModel) -> Float[ndarray, "height width 3"]:
        before = self._camera
        if before is None or not _is_same(before, camera):
            self._camera, self._rays = camera, camera.rays_of_all()
        return self._rays

    def _edges(
        self,
        points: Float[ndarray, "height width 3"],
        height: float,
        arm: Bool[ndarray, "height width"] | None,
    ) -> _Edges:
        """Return the edges of tops at a height [m], but for those at the arm and the image's."""
        heights, error = np.nan_to_num(points[..., 2], nan=-1.0), self._config.height_error
        top = (np.abs(heights - height) < error).astype(np.uint8)
        top = cv2.morphologyEx(top, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
        high = self._high(heights)
        hidden = _widened(high if arm is None else high | arm)
        unknown = _widened(heights < -0.5)
        contours, _ = cv2.findContours(top, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        rows = [one[:, 0] for one in contours if len(one) >= FEWEST]
        pixels = np.concatenate(rows) if rows else np.zeros((0, 2), dtype=int)
        groups = np.repeat(np.arange(len(rows)), [len(one) for one in rows])
        across, down = pixels[:, 0], pixels[:, 1]
        tall, wide = heights.shape
        inside = (across > 0) & (down > 0) & (across < wide - 1) & (down < tall - 1)
        clear = inside & ~hidden[down, across] & ~unknown[down, across]
        pixels, across, down, groups = pixels[clear], across[clear], down[clear], groups[clear]
        places = points[down, across, :2]
        finite = np.isfinite(places).all(axis=1)
        grain = 0.0
        if self._camera is not None and finite.any():
            reach = np.linalg.norm(points[down, across][finite] - self._camera.place, axis=1)
            grain = float(np.median(reach)) / float(self._camera.matrix[0, 0])
        return _Edges(places[finite], pixels[finite].astype(np.float64), groups[finite], grain)

    def _place(
        self,
        body: int,
        edges: _Edges,
        starts: Sequence[Pose],
        taken: Sequence[tuple[Pose, float]],
        least_share: float = 0.0,
    ) -> Sighting | None:
        """Return the body at the pose that fits the edges best; None: none does.

        So much of its outline must be seen, at least.
        """
        if len(edges.places) < FEWEST:
            return None
        fitted = [fit for start in starts if (fit := self._fit(body, edges, start)) is not None]
        free = [
            (misfit - 0.01 * sighting.score, sighting)
            for misfit, sighting in fitted
            if sighting.score >= least_share
            and all(np.hypot(*(sighting.pose - pose)[:2]) >= least for pose, least in taken)
        ]
        return min(free, key=lambda one: one[0])[1] if free else None

    def _starts(self, body: int, edges: _Edges, taken: list[tuple[Pose, float]]) -> list[Pose]:
        """Return the poses to begin with whose outlines are nearest to edges, from all headings.

        The outline's middle is laid onto that of each group of edges, of the `MOST_GROUPS` largest.
        """
        reach = self._bodies.radii[body] * self._bodies.bodies.shapes[body].circumradius
        round_body = self._bodies.bodies.shapes[body].is_round
        turns = np.zeros(1) if round_body else np.arange(HEADINGS) * 2 * np.pi / HEADINGS
        marks = np.stack([turned(self._outlines[body][0], turn) for turn in turns.tolist()])
        middle = (marks.min(axis=1) + marks.max(axis=1)) / 2  # (T, 2)
        starts: list[tuple[float, Pose]] = []
        for own in self._groups(edges, reach, taken):
            places = (own.min(axis=0) + own.max(axis=0)) / 2 - middle
            few = own[:: max(1, len(own) // COARSE)]
            apart = np.linalg.norm(
                few[:, None, None] - (marks + places[:, None])[:, :: MARKS // COARSE], axis=3
            )  # (E, T, M)
            far = apart.min(axis=0).mean(axis=1) + apart.min(axis=2).mean(axis=0)
            starts += [
                (float(misfit), np.array([*place, turn]))
                for misfit, place, turn in zip(far, places, turns, strict=True)
            ]
        return [pose for _, pose in sorted(starts, key=lambda one: one[0])[:MOST_FITS]]

    def _groups(
        self, edges: _Edges, reach: float, taken: list[tuple[Pose, float]]
    ) -> list[Float[ndarray, "P 2"]]:
        """Return edges that may show a body of a circumradius [m]: groups, or parts of them."""
        found: list[Float[ndarray, "P 2"]] = []
        counts = np.bincount(edges.groups, minlength=1)
        for group in np.argsort(-counts)[:MOST_GROUPS].tolist():
            own = edges.places[edges.groups == group]
            for pose, least in taken:
                own = own[np.linalg.norm(own - pose[:2], axis=1) > 2.2 * least]
            if len(own) < FEWEST or np.ptp(own, axis=0).max() < SURE * reach:
                continue
            found.append(own)
            if np.ptp(own, axis=0).max() > 2.5 * reach:  # some that touch: a part of them
                spots = own[:: max(1, len(own) // SPOTS)][:SPOTS]
                found += [own[np.linalg.norm(own - spot, axis=1) < reach] for spot in spots]
        return found[:MOST_GROUPS]

    def _fit(self, body: int, edges: _Edges, start: Pose) -> tuple[float, Sighting] | None:
        """Return the misfit [m] and the sighting of a body near a pose; None: it is not there."""
        config, marks = self._config, self._outlines[body]
        shape = self._bodies.bodies.shapes[body]
        reach = self._bodies.radii[body] * shape.circumradius + GATES[0]
        around = np.flatnonzero(np.linalg.norm(edges.places - start[:2], axis=1) < 1.5 * reach)
        around = around[:: max(1, len(around) // MOST)]
        places, pixels = edges.places[around], edges.pixels[around]
        pose, information, errors = start.copy(), np.eye(3), np.zeros(0)
        used: Bool[ndarray, "E"] = np.zeros(len(places), dtype=bool)
        prior = np.diag([0.0, 0.0, config.edge_noise**2 / ANY_TURN])
        for turn in range(ROUNDS):
            gate = max(GATES[0] * 0.7**turn, GATES[1])
            placed, normals = _placed(marks, pose)
            nearest, distances = _nearest(placed, places)
            used = distances < gate
            if used.sum() < FEWEST:
                return None
            off = places[used] - placed[nearest[used]]
            normal = normals[nearest[used]]
            # The middle of an edge's pixel is half a pixel inside of the edge.
            errors = (off * normal).sum(axis=1) + edges.grain / 2
            arm = placed[nearest[used]] - pose[:2]
            turning = arm[:, 0] * normal[:, 1] - arm[:, 1] * normal[:, 0]
            turning *= not shape.is_round  # its heading cannot be seen
            gradient = np.column_stack([normal, turning])
            information = gradient.T @ gradient + prior
            if np.linalg.eigvalsh(information[:2, :2])[0] < LEAST * used.sum():
                return None  # one straight edge: the body may lie anywhere along it
            step = np.linalg.solve(information, gradient.T @ errors)
            pose = pose + step
            if turn > 8 and np.abs(step).max() < 1e-5:
                break
        misfit = float(np.sqrt(np.mean(errors**2)))
        placed, _ = _placed(marks, pose)
        seen = _nearest(places[used], placed)[1] < NEAR
        share = float(seen.mean())
        if misfit > config.max_misfit or share < config.least_share:
            return None
        pose[2] = wrap_angle(pose[2])
        # Neighbouring pixels err alike: each mark of the outline counts once.
        often = max(1.0, used.sum() / MARKS)
        covariance = often * config.edge_noise**2 * np.linalg.inv(information)
        outline = pixels[used][None]
        return misfit, Sighting(body, pose, covariance, outline, share)


def _marked(outline: Float[ndarray, "O 2"]) -> tuple[Marks, Marks]:
    """Return places (M, 2) at even distances along a closed outline, and outward normals there."""
    ways = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(ways, axis=1)
    along = np.cumsum(lengths) - lengths
    spots = (np.arange(MARKS) + 0.5) / MARKS * lengths.sum()
    side = np.searchsorted(along, spots, side="right") - 1
    share = (spots - along[side]) / lengths[side]
    places = outline[side] + share[:, None] * ways[side]
    normals = np.stack([ways[side, 1], -ways[side, 0]], axis=1) / lengths[side, None]
    signed = float((outline[:, 0] * ways[:, 1] - outline[:, 1] * ways[:, 0]).sum())
    return places, normals if signed > 0 else -normals


def _placed(marks: tuple[Marks, Marks], pose: Pose) -> tuple[Marks, Marks]:
    heading = float(pose[2])
    return turned(marks[0], heading) + pose[:2], turned(marks[1], heading)


def _nearest(places: Float[ndarray, "A 2"], to: Float[ndarray, "B 2"]) -> tuple[ndarray, ndarray]:
    """Return for each of some points which place is nearest, and how far it is [m]."""
    apart = np.linalg.norm(to[:, None] - places, axis=2)
    return apart.argmin(axis=1), apart.min(axis=1)


def _widened(mask: Bool[ndarray, "height width"]) -> Bool[ndarray, "height width"]:
    grown = cv2.dilate(mask.astype(np.uint8), np.ones((ARM, ARM), np.uint8))
    return np.asarray(grown) > 0


def _is_same(one: CameraModel, other: CameraModel) -> bool:
    return all(
        np.array_equal(getattr(one, item.name), getattr(other, item.name))
        for item in fields(CameraModel)
    )
