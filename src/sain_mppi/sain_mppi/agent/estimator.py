"""Which frames show the bodies at rest after a push, and what is concluded from them.

A frame may have been observed while a push was still under way: frames can be late, and the tool
and the bodies move on. So only frames count that were observed after the push ended, and that show
no motion.
"""

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from sain_core.errors import ErrorCode
from sain_core.model import REGION_STD
from sain_core.scene import MASS, POSITION, RADIUS, move_apart
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Scene
from sain_core.world import PushRecord
from sain_mppi.agent.events import PushDecision, SceneObserved
from sain_mppi.agent.uncertainty import Estimate, EstimatorConfig, Uncertainty, fuse, in_motion

logger = logging.getLogger(__name__)

UNMOVED: Final = 1e-4  # [m], a body that is predicted to move less is not moved
MODEL_ERROR: Final = 1e-4  # [m], standard deviation of a model without regions, at least
MODEL_SHARE: Final = 0.04  # and the share of the way
CARRIED: Final = 2.0  # by how much an error of the start grows in a push
MANY_MOVING: Final = 300  # frames, 10 s at 30 Hz
LEVER: Final = 0.7  # [radii], from errors of places to errors of headings


class Estimator:
    """Turns frames and results of pushes into one estimate of each settled scene."""

    def __init__(
        self, config: EstimatorConfig, patience: float, clock: Callable[[], float]
    ) -> None:
        self.config = config
        self._patience, self._clock = patience, clock
        self._key: tuple[int, int] | None = None
        self._end = -np.inf  # of the latest push [s]
        self._sent: PushDecision | None = None  # without a result
        self._completed: PushDecision | None = None
        self._early: tuple[float, PushDecision | None] | None = None  # result before its scene
        self._reset(None)

    def _reset(self, before: SceneObserved | None) -> None:
        """Forget the frames; the estimate of the scene before was this one."""
        self._before = before
        self.estimated: SceneObserved | None = None
        self._frames: list[SceneObserved] = []
        self._moving = 0  # frames that showed motion
        self._since = self._clock()
        self._made: PushDecision | None = None  # that led to this scene
        self._waiting = False  # for the result of the push that led here
        self.executed: PushRecord | None = None  # led to the estimate from the one before

    def observe(self, frame: SceneObserved) -> None:
        """Take a frame."""
        if frame.key != self._key:
            self._begin(frame)
        if frame.settled and self.estimated is None:
            self._frames.append(frame)

    def _begin(self, frame: SceneObserved) -> None:
        """Begin with another scene."""
        same = self._key is not None and self._key[0] == frame.episode_id
        self._reset(self.estimated if same else None)
        self._key, early, self._early = frame.key, self._early, None
        if not same:
            self._end, self._sent = -np.inf, None
        elif early is not None:
            self._take_end(*early)
        else:
            self._waiting = True

    def sent(self, decision: PushDecision) -> None:
        """Take note of a push that is sent."""
        self._sent = decision

    def completed(self, decision: PushDecision) -> PushDecision:
        """Take note of the regions of a push that was sent; return them with the uncertainty.

        For any thread.
        """
        self._completed = decision
        plan, uncertainty = decision.plan, decision.job.observed.uncertainty
        if plan is None or plan.regions is None or uncertainty is None:
            return decision
        regions = np.hypot(plan.regions, REGION_STD * uncertainty.places)
        return replace(decision, plan=replace(plan, regions=regions))

    def ended(self, push_id: int, code: int, time: float) -> None:
        """Take note that a push, whoever sent it, ended at a time [s], or was refused."""
        own = self._sent is not None and self._sent.push_id == push_id
        made, self._sent = (self._sent, None) if own else (None, self._sent)
        if code != ErrorCode.OK:
            return
        if self._waiting:
            self._take_end(time, made)
        else:
            self._early = time, made

    def _take_end(self, time: float, made: PushDecision | None) -> None:
        self._end, self._made, self._waiting = time, made, False

    def estimate(
        self, bodies_of: Callable[[int], Bodies] = lambda episode_id: PAPER_DISKS
    ) -> SceneObserved | None:
        """Return the estimate of a scene, once, as soon as there are enough frames of it.

        `bodies_of` returns the bodies of an episode.
        """
        if self.estimated is not None or self._key is None or self._is_early():
            return None
        frames = self._at_rest()
        if frames is None:
            return None
        scenes, noise = [frame.scene for frame in frames], self.config.noise_std
        bodies, expected = bodies_of(frames[0].episode_id), self._expected()
        scene, uncertainty = fuse(scenes, noise, expected)
        if bodies.all_round:
            scene = move_apart(scene)
        place, turn = self.config.bias_std
        total = Uncertainty(
            np.hypot(uncertainty.places, place),
            np.hypot(uncertainty.turns, turn),
            self.config.confidence,
        )
        self.estimated = replace(frames[-1], scene=scene, settled=True, uncertainty=total)
        self._conclude(scene, uncertainty)
        return self.estimated

    def _at_rest(self) -> list[SceneObserved] | None:
        """Return frames that show the bodies at rest after the push; None: not enough so far."""
        after = [frame for frame in self._frames if frame.time > self._end]
        for first in range(len(after) - self.config.frames + 1):
            frames = after[first : first + self.config.frames]
            times = np.array([frame.time for frame in frames])
            if not in_motion(np.stack([f.scene for f in frames]), times, self.config.noise_std):
                return frames
            self._drop(frames[0])
        return None

    def _drop(self, frame: SceneObserved) -> None:
        """Do without a frame that shows motion."""
        self._frames.remove(frame)
        self._moving += 1
        if self._moving == MANY_MOVING:
            logger.warning(
                "the bodies do not seem to come to rest: %d frames after the last push show motion;"
                " is their noise larger than estimator.noise, %s?",
                MANY_MOVING,
                self.config.noise,
            )

    def _is_early(self) -> bool:
        """Tell whether the end of the push, and the regions of its prediction, may soon come."""
        complete = self._made is None or self._completion is not None
        if complete and not self._waiting:
            return False
        return self._clock() - self._since < self._patience

    @property
    def _completion(self) -> PushDecision | None:
        made, completed = self._made, self._completed
        if made is None or completed is None or completed.push_id != made.push_id:
            return None
        return completed

    def _expected(self) -> Estimate | None:
        """Return where the push should have led; None: nobody predicted it."""
        made, before = self._completion or self._made, self._start()
        if made is None or before is None or made.predicted is None:
            return None
        regions = None if made.plan is None else made.plan.regions
        scene, certain = before
        way = np.linalg.norm((made.predicted - scene)[:, POSITION], axis=1)
        errors = MODEL_ERROR + MODEL_SHARE * way if regions is None else regions[0] / REGION_STD
        moved = way > UNMOVED
        start = certain.places.max()
        places = np.hypot(errors, np.where(moved, CARRIED * start, certain.places))
        turns = np.where(moved, places, errors) / (LEVER * scene[:, RADIUS])
        return made.predicted, Uncertainty(places, np.hypot(certain.turns, turns))

    def _start(self) -> Estimate | None:
        """Return the estimate that the push started from."""
        start, made = self._before, self._made
        if start is None or start.uncertainty is None or made is None:
            return None
        if made.job.observed.key != start.key:
            return None
        place, turn = self.config.bias_std
        places = np.sqrt(np.maximum(start.uncertainty.places**2 - place**2, 0.0))
        turns = np.sqrt(np.maximum(start.uncertainty.turns**2 - turn**2, 0.0))
        return start.scene, Uncertainty(places, turns)

    def _conclude(self, scene: Scene, uncertainty: Uncertainty) -> None:
        """State the push that led here between two estimates."""
        start, made = self._start(), self._made
        if start is not None and made is not None:
            before, certain = start
            after = scene.copy()
            after[:, MASS:] = before[:, MASS:]  # what the push was planned with
            noise = np.hypot(uncertainty.places, CARRIED * certain.places.max())
            self.executed = PushRecord(made.push, before, after, noise=noise)
