"""From poses to scenes: rest, jumps, ids, and what is wrong. No middleware here.

An episode is a time in which bodies were followed without a jump. A scene is what rests between
two pushes; its number goes up with each executed push, and when somebody moved a body. A body that
is not seen is held where it was, and nothing is settled or at rest during this time. While a push
is under way an arm may hide all bodies: then a look that shows none makes a scene, too.
"""

from collections import OrderedDict, deque
from collections.abc import Mapping

import numpy as np

from sain_core.errors import ErrorCode
from sain_core.scene import SETTLED_SPEED, VELOCITY, VX, is_settled, wrap_angle
from sain_core.shapes.body_file import BodyFile, Poses
from sain_core.types import Scene
from sain_vision.scene.body_track import BodyTrack, Covariance, Observed, Pose, TrackingConfig

REMEMBERED = 1000  # answered pushes: answers may come before the pushes
STIRRED, TURNED = 0.002, 0.02  # [m], [rad], from which on a body was seen to move
UNSEEN = 0.05  # [m/s], in a push: faster than an arm takes for all but at rest
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
        self._tracks = [
            BodyTrack(bodies.called(body), shape.symmetry, config)
            for body, shape in enumerate(bodies.bodies.shapes)
        ]
        self._reference: Poses | None = None  # of this scene, at rest
        self._looked = -np.inf  # the time [s] of the latest look in a push, whatever it shows
        self._begun = False  # whether this process has begun an episode
        self._jump = ""
        self._age = ""
        self._ended = -np.inf  # the time [s] at which the latest push ended
        self._under_way: OrderedDict[int, float] = OrderedDict()  # pushes, and since when
        self._pushed = 0  # body of the latest push
        self._restless_since = 0.0  # [s]
        self._answered: deque[int] = deque(maxlen=REMEMBERED)
        self.lost = ""  # a push without a result, in words
        self.began = False  # whether the latest poses began an episode

    @property
    def stamp(self) -> float:
        """The time [s] of the latest poses, or of a later look."""
        return max(self._looked, *(track.stamp for track in self._tracks))

    @property
    def problem(self) -> str:
        """Why no push should be made, in words; empty: nothing is wrong."""
        if not any(self._tracks):
            return self._age or "no poses have come"
        doubts = (track.doubt for track in self._tracks)
        return self._age or self._jump or next(filter(None, doubts), "") or self._restless()

    @property
    def ready(self) -> bool:
        """Whether there is a scene: poses of all bodies, in an episode."""
        return self._begun and all(self._tracks)

    @property
    def settled(self) -> bool:
        """Whether all bodies rest, and no push is under way."""
        known = self.ready and self._reference is not None
        return known and not (self._under_way or self.problem) and self._rests

    @property
    def busy_with(self) -> int:
        """The push that is under way; 0: none."""
        return next(iter(self._under_way), 0)

    @property
    def _rests(self) -> bool:
        hidden = self.stamp - self._config.max_age  # a body that was seen last before this
        return not any(track.moves or track.stamp < hidden for track in self._tracks)

    def scene(self) -> Scene:
        """Return the bodies (N, 8) as they were seen last.

        Velocities are 0 where all rest. Otherwise at least one body is faster than at rest. In a
        push, its body may be anywhere where the latest look does not show it, and none has shown it
        elsewhere: it is called fast.
        """
        poses = np.stack([track.latest for track in self._tracks])
        poses[:, 2] = wrap_angle(poses[:, 2])
        scene = self._bodies.scene(poses)
        if not self._rests:
            scene[:, VELOCITY] = [track.velocity() for track in self._tracks]
            if is_settled(scene):
                scene[0, VX] = CREEP
        if self._is_pushed_unseen(poses):
            scene[self._pushed, VX] = UNSEEN
        return scene

    def _is_pushed_unseen(self, poses: Poses) -> bool:
        """Return whether a push is under way, and its body was seen last where it was before."""
        body, before = self._pushed, self._reference
        if not self._under_way or before is None or self._tracks[body].stamp >= self._looked:
            return False
        off = poses[body] - before[body]
        return bool(np.hypot(*off[:2]) < STIRRED and abs(wrap_angle(off[2])) < TURNED)

    def estimates(self) -> list[tuple[Pose, Covariance]]:
        """Return where each body is, as a mean of its latest poses, with the covariance of that."""
        return [track.estimate() for track in self._tracks]

    def observe(
        self, seen: Mapping[int, Observed], stamp: float, now: float, whole: bool = False
    ) -> bool:
        """Take poses of some bodies at a time; return whether they, or that there are none, count.

        A `whole` look shows all that can be seen, and so does one that shows nothing. One does not
        count where it is old, or of a time before that of the latest.
        """
        self.began = False
        self._age = self._age_of(stamp, now)
        if self._age:
            return False
        if stamp < self._looked - self._config.max_age:
            self._looked = -np.inf  # whoever sends them began anew
        looks = (whole or not seen) and self.ready and bool(self._under_way) and stamp > self.stamp
        taken = [self._add(body, one, stamp) for body, one in seen.items()]
        self._looked = stamp if looks else self._looked
        self._expire(now)
        self.note_time(now)
        if not any(taken) and not looks:
            return False
        rests = self._rests and not self._age
        if rests or self._under_way or not self._restless_since:
            self._restless_since = stamp
        if rests and not self._under_way:
            self._rest()
        return True

    def _add(self, body: int, one: Observed, stamp: float) -> bool:
        track = self._tracks[body]
        if stamp <= track.stamp:
            if stamp > track.stamp - self._config.max_age:
                return False
            track.forget_until(track.stamp)  # whoever sends them began anew
        self._jump = track.add(one, stamp) or self._jump
        if self._ended - self._config.max_age < stamp <= self._ended:
            track.rest_from(self._ended)  # a camera is late: what rests there was not pushed yet
        return True

    def _age_of(self, stamp: float, now: float) -> str:
        """Return in words what is wrong with the time of poses; empty: nothing."""
        age, most = now - stamp, self._config.max_age
        if age > most:
            return f"the poses are {age:.1f} s old; at most {most:g} s is allowed"
        if age < -most:
            return f"the poses are stamped {-age:.1f} s in the future; {FUTURE}"
        return ""

    def note_time(self, now: float) -> None:
        """Take note of the time: poses that stop coming are old."""
        if self._age or not any(self._tracks):
            return
        stamps = [track.stamp for track in self._tracks]
        if np.isfinite(stamps).any():
            self._age = self._age_of(max(stamps), now)
        body = int(np.argmin(stamps))
        if not (self._age or self._under_way) and self._age_of(stamps[body], now):
            self._age = f"{self._bodies.called(body)} {self._last_seen(body, now)}"

    def _last_seen(self, body: int, now: float) -> str:
        track = self._tracks[body]
        if np.isfinite(track.stamp):
            return f"was last seen {now - track.stamp:.1f} s ago; it is held where it was"
        return "has not been seen since the last push" if track else "has not been seen yet"

    def sent(self, push_id: int, episode_id: int, scene_id: int, now: float, body: int = 0) -> None:
        """Take note of a push of a body: until its result, its scene is not settled."""
        if (episode_id, scene_id) != (self.episode_id, self.scene_id):
            return  # who executes pushes refuses it
        if push_id not in self._answered and len(self._under_way) < REMEMBERED:
            self._under_way.setdefault(push_id, now)
            self._pushed = min(body, len(self._tracks) - 1)

    def answered(self, push_id: int, code: int, end: float) -> bool:
        """Take note of what became of a push that ended at a time; one that was executed counts.

        Return whether that makes a scene: the bodies were seen at rest after it.
        """
        if code == ErrorCode.DUPLICATE_PUSH or push_id in self._answered:
            return False
        self._answered.append(push_id)
        self._under_way.pop(push_id, None)
        self.lost = ""
        if code == ErrorCode.OK:
            self.scene_id += 1
            self._reference = None
            self._ended = end
            for track in self._tracks:
                track.forget_until(end)
        rests = self._rests and not (self._under_way or self._age)
        if rests:
            self._rest()
        return rests

    def _restless(self) -> str:
        """Return in words that bodies do not come to rest; empty: they may."""
        time = self.stamp - self._restless_since
        if time < RESTLESS:
            return ""
        place, turn = np.max([track.scatter() for track in self._tracks], axis=0)
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
        mean, reference = np.stack([t.estimate()[0] for t in self._tracks]), self._reference
        jumped, self._jump = bool(self._jump), ""
        if not self._begun or (jumped and self._is_elsewhere(mean)):
            self._begun = self.began = True
            self.episode_id += 1
            self.scene_id += 1
        elif reference is not None and self._is_elsewhere(mean):
            self.scene_id += 1  # somebody moved a body
        elif reference is not None:
            return
        self._reference = mean

    def _is_elsewhere(self, mean: Poses) -> bool:
        if self._reference is None:
            return True
        pairs = zip(self._tracks, self._reference, mean, strict=True)
        return any(track.differs(one, other) for track, one, other in pairs)
