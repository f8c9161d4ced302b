"""From poses to scenes: ids, rest, and what is wrong. No middleware here.

An episode is a time in which bodies were followed without a jump. A scene is what rests between
two pushes; its number goes up with each executed push, and when somebody moved a body.
"""

from collections import OrderedDict, deque

import numpy as np

from sain_core.errors import ErrorCode, InvalidInputError
from sain_core.scene import SETTLED_SPEED, VELOCITY, VX, is_settled
from sain_core.types import Scene
from sain_sim.camera.body_file import BodyFile, Poses
from sain_sim.camera.pose_window import PoseWindow, wrapped
from sain_sim.camera.settings import TrackingConfig

REMEMBERED = 1000  # answered pushes: answers may come before the pushes
CREEP = 2.0 * SETTLED_SPEED  # [m/s], where rest is not known yet
RESTLESS = 5.0  # [s] of motion without a push
FUTURE = "is the camera's clock set, and is use_sim_time the same for all nodes?"


class SceneTracker:
    """Follows the bodies of one table. Times are in seconds, by the clock of the poses."""

    def __init__(
        self, bodies: BodyFile, config: TrackingConfig, left: tuple[int, int] = (0, 0)
    ) -> None:
        """Begin without poses, after these ids of episode and scene."""
        self._bodies, self._config = bodies, config
        self.episode_id, self.scene_id = left
        self._window = PoseWindow(bodies, config)
        self._reference: Poses | None = None  # of this scene, at rest
        self._begun = False  # whether this process has begun an episode
        self._jump = ""
        self._age = ""
        self._under_way: OrderedDict[int, float] = OrderedDict()  # pushes, and since when
        self._restless_since = 0.0  # [s]
        self._answered: deque[int] = deque(maxlen=REMEMBERED)
        self.lost = ""  # a push without a result, in words
        self.began = False  # whether the latest poses began an episode

    @property
    def stamp(self) -> float:
        """The time [s] of the latest poses."""
        return self._window.stamp

    @property
    def problem(self) -> str:
        """Why no push should be made, in words; empty: nothing is wrong."""
        if not self._window:
            return self._age or "no poses have come"
        return self._age or self._jump or self._restless()

    @property
    def ready(self) -> bool:
        """Whether there is a scene: poses, in an episode."""
        return bool(self._window) and self._begun

    @property
    def settled(self) -> bool:
        """Whether all bodies rest, and no push is under way."""
        known = self.ready and self._reference is not None
        return known and not (self._under_way or self.problem) and self._window.at_rest()

    @property
    def busy_with(self) -> int:
        """The push that is under way; 0: none."""
        return next(iter(self._under_way), 0)

    def scene(self) -> Scene:
        """Return the bodies (N, 8) as they were seen last.

        Velocities are 0 where all rest. Otherwise at least one body is faster than at rest.
        """
        scene = self._bodies.scene(wrapped(self._window.latest))
        if not self._window.at_rest():
            scene[:, VELOCITY] = self._window.velocities()
            if is_settled(scene):
                scene[0, VX] = CREEP
        return scene

    def see(self, poses: Poses, stamp: float, now: float) -> bool:
        """Take poses (N, 3) of a time; return whether they are used: neither old nor out of order.

        Raises:
            InvalidInputError: another number of bodies, or NaN.
        """
        self.began = False
        count = len(self._bodies.names)
        if len(poses) != count:
            raise InvalidInputError(f"{len(poses)} poses came; the bodies file has {count} bodies")
        if not np.isfinite(poses).all():
            raise InvalidInputError("a pose is NaN or Inf; all must be finite")
        if not self.check_age(stamp, now):
            return False
        if self._window and stamp <= self._window.stamp:
            if stamp > self._window.stamp - self._config.max_age:
                return False
            self._window.clear()  # whoever sends them began anew
        self._jump = self._window.add(poses, stamp) or self._jump
        self._expire(now)
        rests = self._window.at_rest()
        if rests or self._under_way or not self._restless_since:
            self._restless_since = stamp
        if rests and not self._under_way:
            self._rest()
        return True

    def check_age(self, stamp: float, now: float) -> bool:
        """Tell whether poses of a time are new enough; `problem` says why not."""
        age, most = now - stamp, self._config.max_age
        self._age = ""
        if age > most:
            self._age = f"the poses are {age:.1f} s old; at most {most:g} s is allowed"
        elif age < -most:
            self._age = f"the poses are stamped {-age:.1f} s in the future; {FUTURE}"
        if self._age:
            self._window.clear()
        return not self._age

    def look(self, now: float) -> None:
        """Take note of the time: poses that stop coming are old."""
        if self._window:
            self.check_age(self._window.stamp, now)

    def sent(self, push_id: int, episode_id: int, scene_id: int, now: float) -> None:
        """Take note of a push: until its result, its scene is not settled."""
        if (episode_id, scene_id) != (self.episode_id, self.scene_id):
            return  # who executes pushes refuses it
        if push_id not in self._answered and len(self._under_way) < REMEMBERED:
            self._under_way.setdefault(push_id, now)

    def answered(self, push_id: int, code: int, end: float) -> None:
        """Take note of what became of a push that ended at a time; one that was executed counts."""
        if code == ErrorCode.DUPLICATE_PUSH or push_id in self._answered:
            return
        self._answered.append(push_id)
        self._under_way.pop(push_id, None)
        self.lost = ""
        if code == ErrorCode.OK:
            self.scene_id += 1
            self._reference = None
            self._window.forget_until(end)

    def _restless(self) -> str:
        """Return in words that bodies do not come to rest; empty: they may."""
        time = self.stamp - self._restless_since
        if time < RESTLESS:
            return ""
        place, turn = self._window.scatter()
        return (
            f"the bodies have not come to rest for {time:.0f} s: places scatter by"
            f" {1e3 * place:.1f} mm, headings by {turn:.3f} rad, and noise is {self._config.noise};"
            " give the noise of the poses"
        )

    def _expire(self, now: float) -> None:
        for push_id, since in list(self._under_way.items()):
            if now - since > self._config.push_timeout:
                del self._under_way[push_id]
                self.lost = f"push {push_id} has no result after {now - since:.0f} s"

    def _rest(self) -> None:
        """Take bodies at rest for the scene of the latest push, or for another one."""
        mean, reference = self._window.mean, self._reference
        jumped, self._jump = bool(self._jump), ""
        if not self._begun or (jumped and self._is_elsewhere(mean)):
            self._begun = self.began = True
            self.episode_id += 1
            self.scene_id += 1
        elif reference is not None and self._window.differs(reference, mean):
            self.scene_id += 1  # somebody moved a body
        elif reference is not None:
            return
        self._reference = mean

    def _is_elsewhere(self, mean: Poses) -> bool:
        return self._reference is None or self._window.differs(self._reference, mean)
