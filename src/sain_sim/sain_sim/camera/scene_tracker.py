"""From poses to scenes: rest, jumps, ids, and what is wrong. No middleware here.

An episode is a time in which bodies were followed without a jump. A scene is what rests between
two pushes; its number goes up with each executed push, and when somebody moved a body.
"""

from collections import OrderedDict, deque
from dataclasses import dataclass
from math import pi

import numpy as np

from sain_core.config import Config, option
from sain_core.errors import ErrorCode, InvalidInputError
from sain_core.scene import SETTLED_SPEED, VELOCITY, VX, is_settled, wrap_angle
from sain_core.shapes.body_file import BodyFile, Poses
from sain_core.types import Scene
from sain_core.world import ObservationConfig

SCATTER = 5.0  # standard deviations that a pose may be off
AT_ONCE = 0.005  # [m], that two poses may differ at any time
TURN_AT_ONCE = 0.05  # [rad]
ROUNDING = 1e-5  # [s], of stamps
SHORTEST = 0.05  # [s], over which a velocity is a difference
REMEMBERED = 1000  # answered pushes: answers may come before the pushes
CREEP = 2.0 * SETTLED_SPEED  # [m/s], where rest is not known yet
RESTLESS = 5.0  # [s] of motion without a push
FUTURE = "is the camera's clock set, and is use_sim_time the same for all nodes?"


@dataclass(frozen=True)
class TrackingConfig(Config):
    """How poses of bodies become scenes."""

    noise: str = option(
        "0,0",
        "standard deviation of the poses, as the planner's `estimator.noise`: METRES,RADIANS",
    )
    rest_time: float = option(
        0.3, "time without motion after which bodies are at rest", unit="s", minimum=0.05
    )
    rest_distance: float = option(
        0.0005, "motion in this time that counts as none, besides noise", unit="m", minimum=1e-5
    )
    rest_turn: float = option(0.005, "the same for headings", unit="rad", minimum=1e-4)
    max_speed: float = option(
        1.0, "fastest motion of a body; more is a jump", unit="m/s", minimum=0.01
    )
    max_spin: float = option(
        15.0, "fastest turn of a body; more is a jump", unit="rad/s", minimum=0.1
    )
    max_age: float = option(0.5, "age above which poses are not used", unit="s", minimum=0.02)
    push_timeout: float = option(
        60.0, "time after which a push without a result counts as lost", unit="s", minimum=1.0
    )

    def __post_init__(self) -> None:
        """Check the fields and the numbers in words."""
        super().__post_init__()
        ObservationConfig(noise=self.noise)

    @property
    def noise_std(self) -> tuple[float, float]:
        """The noise of a pose, [m] and [rad]."""
        return ObservationConfig(noise=self.noise).noise_std


@dataclass(frozen=True)
class PosesConfig(TrackingConfig):
    """What the converter of poses reads, and how often it publishes."""

    bodies: str = option("", "YAML file of the bodies: shape, role, radius, mass, frame")
    frame: str = option("world", "frame of the poses, whose z axis points up")
    rate: float = option(30.0, "most scenes per second", unit="Hz", minimum=1.0, maximum=240.0)
    state_file: str = option("", "file that keeps the ids, so that none is used twice; empty: none")


class PoseWindow:
    """Poses within the time that bodies must be at rest, with continuous headings."""

    def __init__(self, bodies: BodyFile, config: TrackingConfig) -> None:
        """Begin without poses."""
        self._bodies, self._config = bodies, config
        self._known: deque[tuple[float, Poses]] = deque()
        self._since = 0.0  # of the first of poses that follow each other
        place, turn = config.noise_std
        self.slack = np.array([config.rest_distance + SCATTER * place] * 2 + [0.0])
        self.slack[2] = config.rest_turn + SCATTER * turn

    def __bool__(self) -> bool:
        """Return whether there are poses."""
        return bool(self._known)

    @property
    def stamp(self) -> float:
        """The time [s] of the latest poses."""
        return self._known[-1][0]

    @property
    def latest(self) -> Poses:
        """The latest poses (N, 3)."""
        return self._known[-1][1]

    @property
    def mean(self) -> Poses:
        """The mean of the poses (N, 3)."""
        return np.mean([poses for _, poses in self._known], axis=0)

    def clear(self) -> None:
        """Forget all poses."""
        self._known.clear()

    def forget_until(self, stamp: float) -> None:
        """Forget the poses up to a time [s]."""
        while self._known and self._known[0][0] <= stamp:
            self._known.popleft()
        if self._known:
            self._since = self._known[0][0]

    def add(self, poses: Poses, stamp: float) -> str:
        """Add poses (N, 3) of a time [s]; return in words which body jumped; empty: none."""
        jump = ""
        if self._known:
            poses = self.continued(poses, self.latest)
            jump = self._jump(poses, stamp - self.stamp)
        if jump or not self._known:
            self._known.clear()
            self._since = stamp
        self._known.append((stamp, poses))
        while len(self._known) > 2 and self._known[1][0] <= stamp - self._config.rest_time:
            self._known.popleft()
        return jump

    def continued(self, poses: Poses, before: Poses) -> Poses:
        """Return poses with the headings that are nearest to those before.

        A body that looks the same after a turn may be seen at any such turn.
        """
        near = poses.copy()
        for body, shape in enumerate(self._bodies.bodies.shapes):
            turn = shape.symmetry
            if turn == 0.0:
                near[body, 2] = before[body, 2]  # a disk's heading is no observation
                continue
            off = poses[body, 2] - before[body, 2]
            near[body, 2] = before[body, 2] + off - turn * np.round(off / turn)
        return near

    def at_rest(self) -> bool:
        """Return whether nothing moved for the time that it takes to be at rest."""
        if not self._known or self.stamp - self._since < self._config.rest_time - ROUNDING:
            return False
        poses = np.stack([poses for _, poses in self._known])
        return bool((np.abs(poses - poses.mean(axis=0)) <= self.slack).all())

    def scatter(self) -> tuple[float, float]:
        """Return the largest standard deviation of a body's place [m] and of its heading [rad]."""
        spread = np.std([poses for _, poses in self._known], axis=0)
        return float(spread[:, :2].max()), float(spread[:, 2].max())

    def velocities(self) -> Poses:
        """Return the velocities (N, 3) [m/s, rad/s], as differences."""
        for stamp, poses in reversed(self._known):
            if (time := self.stamp - stamp) >= SHORTEST:
                return (self.latest - poses) / time
        return np.zeros_like(self.latest)

    def differs(self, one: Poses, other: Poses) -> bool:
        """Return whether poses (N, 3) at rest are others than before."""
        off = self.continued(other, one) - one
        return bool((np.abs(off) > 2.0 * self.slack).any())

    def _jump(self, poses: Poses, time: float) -> str:
        config, (place, turn) = self._config, self._config.noise_std
        off = poses - self.latest
        way, spin = np.hypot(off[:, 0], off[:, 1]), np.abs(off[:, 2])
        far = config.max_speed * time + AT_ONCE + 2 * SCATTER * place
        wide = min(config.max_spin * time + TURN_AT_ONCE + 2 * SCATTER * turn, pi)
        for body, (length, angle) in enumerate(zip(way.tolist(), spin.tolist(), strict=True)):
            if length > far:
                what, most = f"{length:.3f} m", f"{config.max_speed:g} m/s"
            elif angle > wide:
                what, most = f"{angle:.2f} rad", f"{config.max_spin:g} rad/s"
            else:
                continue
            return (
                f"{self._bodies.called(body)} jumped by {what} in {time:.3f} s; at most {most} is"
                " taken for motion: nothing is pushed until all rest"
            )
        return ""


def wrapped(poses: Poses) -> Poses:
    """Return poses (N, 3) with headings in (-pi, pi]."""
    result = poses.copy()
    result[:, 2] = wrap_angle(poses[:, 2])
    return result


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

    def observe(self, poses: Poses, stamp: float, now: float) -> bool:
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
        """Return whether poses of a time are new enough; `problem` says why not."""
        age, most = now - stamp, self._config.max_age
        self._age = ""
        if age > most:
            self._age = f"the poses are {age:.1f} s old; at most {most:g} s is allowed"
        elif age < -most:
            self._age = f"the poses are stamped {-age:.1f} s in the future; {FUTURE}"
        if self._age:
            self._window.clear()
        return not self._age

    def note_time(self, now: float) -> None:
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
