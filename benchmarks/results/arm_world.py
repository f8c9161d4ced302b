"""A simulated robot among bodies of a file, and how it sees them by images alone.

Images, detection, scenes, planning, the arm's way and the physics are the parts that run in the
graph; there are no topics in between, and no wall clock.
"""

import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from sain_bringup.graph import OUTLINES, SEEN_NOISE
from sain_core.camera.image_camera import ImageCameraConfig
from sain_core.errors import ErrorCode, SainError
from sain_core.randomness import generator
from sain_core.scene import MASS
from sain_core.shapes.body_file import BodyFile
from sain_core.types import PushArray, Scene
from sain_core.world import Outcome
from sain_eval.loop.play import Sight
from sain_sim.bench.bench import parameters_of
from sain_sim.bench.report import RATE, Report
from sain_sim.camera.renderer import image_camera
from sain_sim.world.truth import TruthConfig, hidden_world
from sain_sim.world.workcell import Sample, WorldConfig, steps_of
from sain_sim.world.world import World
from sain_vision.detection.arm_mask import ArmMask
from sain_vision.detection.outlines import OutlineConfig, OutlineFinder
from sain_vision.detection.sighting import Sighting
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel
from sain_vision.scene.body_track import Observed, TrackingConfig
from sain_vision.scene.scene_tracker import SceneTracker

LATENCY = 0.06  # [s], from an image to the pose in it
PATIENCE = 12.0  # [s], then nothing is seen


class ArmWorld:
    """A robot and bodies of a file, with masses as in the file; counts what pushes break."""

    def __init__(self, bodies: BodyFile, cell: WorldConfig, seed: int, engine: str) -> None:
        """Draw what is hidden from a seed."""
        truth = TruthConfig(hidden_world(engine), lab=seed, engine=engine)
        self.cell = World(parameters_of(bodies, truth, seed), cell, engine)
        self._masses, self._pushes, self._refused = bodies.masses, 0, list[str]()
        self.report = Report(self.cell.robot, bodies.bodies, bodies.radii)
        self._began, self._wall = self.cell.time, time.monotonic()

    def reset(self, start: Scene) -> Scene:
        """Put the bodies where a scene (N, 8) has them."""
        self.cell.place(start)
        return self.observe()

    def observe(self) -> Scene:
        """Return the bodies (N, 8)."""
        return self._seen(self.cell.observe())

    def push(self, push: PushArray, *, seen: Scene | None = None) -> Outcome:
        """Push, and look at the arm all the way; raises as `World.push`."""
        try:
            outcome = self.cell.push(push, self._look, steps_of(1.0 / RATE), seen)
        except SainError as error:
            self._refused.append(f"{type(error).__name__}: {error}")
            raise
        self._pushes += 1
        self._seen(outcome.before), self._seen(outcome.after)
        return outcome

    def counts(self) -> dict[str, Any]:
        """Return all that was counted."""
        times = {
            "time": round(self.cell.time - self._began, 2),
            "wall": round(time.monotonic() - self._wall, 1),
        }
        report = {"limits": dict(self.report.limits), "contacts": dict(self.report.contacts)}
        return {"pushes": self._pushes, "refused": self._refused} | report | times

    def _look(self, sample: Sample) -> None:
        self.report.look(sample.joint_positions, sample.joint_velocities, sample.scene)

    def _seen(self, scene: Scene) -> Scene:
        scene[:, MASS] = self._masses
        return scene


class ImageSight(Sight):
    """Sees a world by its camera's images alone. Its time is that of the world."""

    world: ArmWorld

    def __init__(self, world: ArmWorld, bodies: BodyFile, see: str, seed: int) -> None:
        """Stand over the table."""
        super().__init__(world)
        config = ImageCameraConfig()
        if see == OUTLINES:
            config = replace(config, width=640, height=480, detail=1.0)
        self._camera = image_camera(
            config, world.cell.robot, bodies.bodies, bodies.radii, tags=bodies.tags
        )
        self._steps = steps_of(1.0 / config.rate)
        size, lens = (config.width, config.height), np.array(config.distortion)
        self._model = CameraModel(*size, config.matrix, lens, *config.stated_pose)
        self._random = generator(seed, "images")
        self._outlines = OutlineFinder(bodies, OutlineConfig()) if see == OUTLINES else None
        self._mask = ArmMask(world.cell.robot)
        self._tags = TagFinder(TagConfig()), TagLocator(bodies, TagConfig())
        self._last: dict[int, np.ndarray] = {}
        self._pushes = 0
        self.tracker = SceneTracker(bodies, TrackingConfig(noise=SEEN_NOISE[see]))

    @property
    def time(self) -> float:
        """Time of the world [s]."""
        return self.world.cell.time

    def look(self) -> Iterator[tuple[Scene, float]]:
        """Yield scenes at rest, one of each image; none comes if nothing rests."""
        while self._await_rest():
            yield self.tracker.scene(), self.tracker.stamp

    def push(self, push: PushArray, seen: Scene) -> Scene:
        """Push; return the scene that is seen next, at rest."""
        self._pushes += 1
        ids, tracker = (self.tracker.episode_id, self.tracker.scene_id), self.tracker
        tracker.sent(self._pushes, *ids, self.time)
        try:
            self.world.push(push, seen=seen)
        except SainError:
            tracker.answered(self._pushes, int(ErrorCode.BLOCKED), self.time)
            raise
        tracker.answered(self._pushes, int(ErrorCode.OK), self.time)
        self._await_rest()
        return tracker.scene()

    def _await_rest(self) -> bool:
        """Take images until bodies rest."""
        began = self.time
        while self.time < began + PATIENCE:
            self._take()
            if self.tracker.settled:
                return True
        return False

    def _take(self) -> None:
        world = self.world.cell
        joints, _ = world.joint_states()
        for _ in range(self._steps):
            world.step(joints, np.zeros_like(joints))
        stamp = self.time
        shot = self._camera.take(joints, world.observe(), self._random)
        seen = {
            one.body: Observed(one.pose, one.covariance)
            for one in self._found(shot.colour, shot.depth)
        }
        self.tracker.observe(seen, stamp, stamp + LATENCY)

    def _found(self, colour: np.ndarray, depth: np.ndarray) -> list[Sighting]:
        if self._outlines is None:
            finder, locator = self._tags
            grey = np.asarray(cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY))
            return locator.locate(finder.find(grey), self._model)[0]
        metres = np.where(depth > 0, depth * 1e-3, np.nan)
        known = {body: [pose] for body, pose in self._last.items()}
        arm = self._mask.draw(self.world.cell.joint_states()[0], self._model)
        found = self._outlines.find(metres, self._model, known, arm=arm)[0]
        self._last |= {one.body: one.pose for one in found}
        return found
