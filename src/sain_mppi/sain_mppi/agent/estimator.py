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
from sain_core.history import PushHistory
from sain_core.model import REGION_STD
from sain_core.observation import RADII
from sain_core.push import PushLimits
from sain_core.scene import MASS, POSITION, RADIUS
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.world import PushRecord
from sain_mppi.agent.decision import PushDecision, View
from sain_mppi.agent.estimate import Estimate, EstimatorConfig, fuse, in_motion, part_disks
from sain_mppi.agent.radii import RadiusFilter
from sain_mppi.agent.uncertainty import Uncertainty

logger = logging.getLogger(__name__)

UNMOVED: Final = 1e-4  # [m], a body that is predicted to move less is not moved
MODEL_ERROR: Final = 1e-4  # [m], standard deviation of a model without regions, at least
MODEL_SHARE: Final = 0.04  # and the share of the way
CARRIED: Final = 2.0  # by how much an error of the start grows in a push
MANY_MOVING: Final = 300  # frames, 10 s at 30 Hz
LEVER: Final = 0.7  # [radii], from errors of places to errors of headings


class Estimator:
    """Turns frames and results of pushes into one view of each settled scene."""

    def __init__(
        self,
        config: EstimatorConfig,
        patience: float,
        clock: Callable[[], float],
        limits: PushLimits = PushLimits(),
    ) -> None:
        """Begin without a frame; wait for the result of a push at most so long [s].

        `limits` tell where the tool starts and ends.
        """
        self.config, self._limits = config, limits
        self._patience, self._clock = patience, clock
        self._key: tuple[int, int] | None = None
        self._end = -np.inf  # of the latest push [s]
        self._sent: PushDecision | None = None  # without a result
        self._completed: PushDecision | None = None
        self._early: tuple[float, PushDecision | None] | None = None  # result before its scene
        self._radii: RadiusFilter | None = None  # where they are not measured
        self._reset(None)

    def _reset(self, before: View | None) -> None:
        """Forget the frames; the scene before was this one."""
        self._before = before
        self.view: View | None = None
        self._frames: list[View] = []
        self._moving = 0  # frames that showed motion
        self._since = self._clock()
        self._made: PushDecision | None = None  # that led to this scene
        self._waiting = False  # for the result of the push that led here
        self.pushed: PushRecord | None = None  # that led to the view, if its start is known

    def see(self, frame: View) -> None:
        """Take a frame."""
        if frame.key != self._key:
            self._begin(frame)
        if frame.settled and self.view is None:
            self._frames.append(frame)

    def _begin(self, frame: View) -> None:
        """Begin with another scene."""
        same = self._key is not None and self._key[0] == frame.episode_id
        self._reset(self.view if same else None)
        self._key, early, self._early = frame.key, self._early, None
        if not same:
            self._end, self._sent, self._radii = -np.inf, None, None
        elif early is not None:
            self._take_end(*early)
        else:
            self._waiting = True

    def sent(self, decision: PushDecision) -> None:
        """Take note of a push that is sent."""
        self._sent = decision

    def completed(self, decision: PushDecision) -> PushDecision:
        """Take note of the regions of a push that was sent; return them with what is not sure.

        For any thread.
        """
        self._completed = decision
        plan, sure = decision.plan, decision.job.view.sure
        if plan is None or plan.regions is None or sure is None:
            return decision
        regions = np.hypot(plan.regions, REGION_STD * sure.places)
        return replace(decision, plan=replace(plan, regions=regions))

    def answered(self, push_id: int, code: int, time: float) -> None:
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
    ) -> View | None:
        """Return the view of a scene, once, as soon as there are enough frames of it.

        `bodies_of` returns the bodies of an episode.
        """
        if self.view is not None or self._key is None or self._is_early():
            return None
        frames = self._at_rest()
        if frames is None:
            return None
        scenes, noise = [frame.scene for frame in frames], self.config.noise_std
        known = bodies_of(frames[0].episode_id)
        expected = self._expected()
        found = fuse(scenes, noise, expected)
        if RADII in self.config.unknown_names:
            self._measure(fuse(scenes, noise), expected, known)
        if self._radii is not None:
            found = replace(found, scene=self._radii.apply(found.scene))
        if known.all_round:
            found = replace(found, scene=part_disks(found.scene))
        self.view = self._view(frames[-1], found)
        self._learn(found)
        return self.view

    def _at_rest(self) -> list[View] | None:
        """Return frames that show the bodies at rest after the push; None: not enough so far."""
        after = [frame for frame in self._frames if frame.observed > self._end]
        for first in range(len(after) - self.config.frames + 1):
            frames = after[first : first + self.config.frames]
            times = np.array([frame.observed for frame in frames])
            if not in_motion(np.stack([f.scene for f in frames]), times, self.config.noise_std):
                return frames
            self._drop(frames[0])
        return None

    def _drop(self, frame: View) -> None:
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

    def _measure(self, seen: Estimate, expected: Estimate | None, bodies: Bodies) -> None:
        """Learn the radii of disks from what frames show, and from the push before them."""
        if self._radii is None:
            self._radii = RadiusFilter(seen.scene[:, RADIUS], bodies)
        start, made = self._start(), self._made
        if expected is not None and start is not None and made is not None:
            before, after = start.scene, seen.scene
            self._radii.learn(before, made.push, expected.scene, after, seen.places)
        self._radii.look(seen.scene, seen.places)

    def retold(self, history: PushHistory) -> PushHistory:
        """Return earlier pushes of the episode as they would be stated with what is known now."""
        if self._radii is None or len(history) == 0 or self.view is None:
            return history
        return self._radii.retold(history, self._limits)

    def _is_early(self) -> bool:
        """Tell whether it may soon be known when the push ended, and how sure its prediction is."""
        known = self._made is None or self._completion is not None
        if known and not self._waiting:
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
        way = np.linalg.norm((made.predicted - before.scene)[:, POSITION], axis=1)
        errors = MODEL_ERROR + MODEL_SHARE * way if regions is None else regions[0] / REGION_STD
        moved = way > UNMOVED
        start = before.places.max() + (0.0 if self._radii is None else self._radii.std.max())
        places = np.hypot(errors, np.where(moved, CARRIED * start, before.places))
        lever = LEVER * before.scene[:, RADIUS]
        turns = np.hypot(before.turns, np.where(moved, places, errors) / lever)
        return Estimate(made.predicted, places, turns)

    def _start(self) -> Estimate | None:
        """Return the estimate that the push started from."""
        start, made = self._before, self._made
        if start is None or start.sure is None or made is None or made.job.view.key != start.key:
            return None
        place, turn = self.config.bias_std
        places = np.sqrt(np.maximum(start.sure.places**2 - place**2, 0.0))
        turns = np.sqrt(np.maximum(start.sure.turns**2 - turn**2, 0.0))
        return Estimate(start.scene, places, turns)

    def _learn(self, found: Estimate) -> None:
        start, made = self._start(), self._made
        if start is not None and made is not None:
            noise = np.hypot(found.places, CARRIED * start.places.max())
            after = found.scene.copy()
            after[:, MASS:] = start.scene[:, MASS:]  # what the push was planned with
            self.pushed = PushRecord(made.push, start.scene, after, noise=noise)

    def _view(self, frame: View, found: Estimate) -> View:
        place, turn = self.config.bias_std
        sure = Uncertainty(
            np.hypot(found.places, place), np.hypot(found.turns, turn), self.config.confidence
        )
        return View(
            found.scene, *frame.key, True, frame.received, observed=frame.observed, sure=sure
        )
