"""judo's cylinder_push as a world of strokes: its own task object, stepped as judo steps it.

A metre there is a decimetre here, so that its cylinders have about the size of our disks. The
pusher is a cylinder on two position actuators; an adapter turns a stroke into their targets.
"""

from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from benchmarks.peer_optimizers import INSTALL
from sain_core.errors import ConfigError
from sain_core.push import LENGTH, PushLimits, strokes
from sain_core.scene import POSITION, make_scene, unit
from sain_core.types import Points, PushArray, Scalars, Scene
from sain_pusht.motion import Room, path_round

SCALE: Final = 0.1  # our metres in one of judo's
STEPS: Final = 750  # of an episode: `max_num_task_steps` of judo's run_mpc, 15 s
EVERY: Final = 2  # steps from look to look: judo's control_freq of 20 Hz, as run_mpc rounds it
LEFT: Final = 0.003  # [m], of judo: a stroke slows down as if it went on by this
CORNERS: Final = 32  # of the outline for ways round the cart
ROOM: Final = Room(-5.0, 5.0)  # of the floor of 20 m

Place = Float[ndarray, "2"]


@dataclass(frozen=True)
class CylinderPace:
    """How the pusher moves, in judo's metres.

    Attributes:
        free: speed on the way to a stroke [m/s].
        pushing: largest speed of a stroke [m/s].
        speeding: acceleration [m/s^2].
        slowing: speed near the end over the way left [1/s]; the cart's own drag slows it by 4/s,
            so it stays in touch.
        keep_off: gap to the cart on the way [m].
    """

    free: float = 4.0
    pushing: float = 1.2
    speeding: float = 10.0
    slowing: float = 3.0
    keep_off: float = 0.06


def make_task() -> Any:
    """Return judo's task. Its robots' meshes are not needed, and not downloaded.

    Raises:
        ConfigError: judo is not installed.
    """
    try:
        from judo.tasks import base, cylinder_push
    except ImportError as error:
        raise ConfigError(f"judo cannot be imported ({error}); {INSTALL}") from error
    base.download_and_extract_meshes = lambda **_: None
    return cylinder_push.CylinderPush()


@dataclass(frozen=True)
class PusherServo:
    """The pusher's actuators: force = gain (target - place) - damping speed."""

    time_step: float
    gain: float
    damping: float
    mass: float
    furthest: float

    @classmethod
    def of(cls, model: Any) -> "PusherServo":
        """Read it from judo's model."""
        return cls(
            float(model.opt.timestep),
            float(model.actuator_gainprm[0, 0]),
            float(model.dof_damping[0]),
            float(model.body("pusher").mass[0]),
            float(model.actuator_ctrlrange[0, 1]),
        )

    def targets(self, place: Place, speed: Place, way: Points) -> Points:
        """Return targets (S, 2) that lead a free pusher through places (S, 2), one a step."""
        found = []
        for wanted in way:
            drag = 1.0 + self.time_step * self.damping / self.mass  # MuJoCo damps implicitly
            needed = drag * (wanted - place) / self.time_step - speed
            target = place + self.mass * needed / (self.time_step * self.gain)
            target = np.clip(target, -self.furthest, self.furthest)
            force = self.gain * (target - place)
            speed = (speed + self.time_step * force / self.mass) / drag
            place = place + self.time_step * speed
            found.append(target)
        return np.array(found)


class CylinderWorld:
    """One episode after another.

    Attributes:
        task: judo's.
        trace: distance [m] of the cart from the goal after each step of the episode.
    """

    def __init__(self, limits: PushLimits, pace: CylinderPace = CylinderPace()) -> None:
        """Make the task; `limits` state where strokes start."""
        self.task = make_task()
        self.limits, self._pace = limits, pace
        self._servo = PusherServo.of(self.task.model)
        self.radius = float(self.task.model.geom("cart").size[0])
        self.trace: list[float] = []

    def reset(self, seed: int) -> Scene:
        """Begin the episode of a seed, drawn by judo's own reset."""
        mujoco.mj_resetData(self.task.model, self.task.data)
        np.random.seed(seed)  # noqa: NPY002  (judo draws from it)
        self.task.reset()
        self.trace = []
        return self.scene

    @property
    def over(self) -> bool:
        """Whether the episode's time is up."""
        return len(self.trace) >= STEPS

    @property
    def distance(self) -> float:
        """The cart's distance [m] from the goal."""
        return float(np.linalg.norm(self.task.data.qpos[2:4] - self.task.config.goal_pos))

    @property
    def scene(self) -> Scene:
        """The cart (1, 8) in our units, taken to be at rest."""
        place = SCALE * self.task.data.qpos[None, 2:4]
        return make_scene(place, np.array([1.0]), np.array([SCALE * self.radius]))

    def step(self, target: Float[ndarray, "2"]) -> None:
        """Do one step of the simulation, as judo's `MJSimulation` does."""
        self.task.data.ctrl[:] = target
        mujoco.mj_step(self.task.sim_model, self.task.data)
        self.trace.append(self.distance)

    def push(self, push: PushArray) -> Scene:
        """Carry out a push (5,); return the scene (1, 8) after it, or when time was up.

        Raises:
            UnreachableError: there is no way to where it starts; nothing has moved.
        """
        start, heading = strokes(self.scene, push, self.limits)
        self.follow(self.way_to(start / SCALE))
        self._stroke((start + push[LENGTH] * unit(heading)) / SCALE)
        return self.scene

    def imagine(self, scene: Scene, push: PushArray) -> Scene:
        """Return the scene (1, 8) after a push (5,) from another scene than there is."""
        start, heading = strokes(scene, push, self.limits)
        self.task.data.qpos[:] = [*start / SCALE, *scene[0, POSITION] / SCALE]
        self.task.data.qvel[:] = 0.0
        self.trace = []
        self._stroke((start + push[LENGTH] * unit(heading)) / SCALE)
        return self.scene

    def _stroke(self, end: Place) -> None:
        first = self.task.data.qpos[:2].copy()
        self.follow(
            along(np.stack([first, end]), stroke_times(end - first, self._pace, self._step))
        )

    @property
    def _step(self) -> float:
        return self._servo.time_step

    def way_to(self, start: Place) -> Points:
        """Return places (S, 2) that lead the pusher round the cart."""
        angles = 2 * np.pi * np.arange(CORNERS) / CORNERS
        size = self.radius / np.cos(np.pi / CORNERS)
        cart, place = self.task.data.qpos[2:4], self.task.data.qpos[:2].copy()
        outline = cart + size * unit(angles)
        way = path_round(place, start, outline, self.radius + self._pace.keep_off, ROOM)
        total = float(np.hypot(*np.diff(way, axis=0).T).sum())
        return along(way, travel_times(total, self._pace.free, self._pace.speeding * 4, self._step))

    def follow(self, way: Points) -> None:
        """Lead the pusher through places (S, 2), one a step, with a look at every second step."""
        data = self.task.data
        for first in range(0, len(way), EVERY):
            part = way[first : first + EVERY]
            for target in self._servo.targets(data.qpos[:2].copy(), data.qvel[:2].copy(), part):
                if self.over:
                    return
                self.step(target)


def along(way: Points, travelled: Scalars) -> Points:
    """Return the places (S, 2) after some travel (S,) along a way (P, 2)."""
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way, axis=0).T))])
    return np.stack([np.interp(travelled, lengths, way[:, axis]) for axis in range(2)], axis=-1)


def travel_times(total: float, speed: float, acceleration: float, step: float) -> Scalars:
    """Return how far (S,) a way leads step by step, from rest to rest."""
    done, now, travelled = 0.0, 0.0, []
    while total - done > 1e-3:
        braking = np.sqrt(2 * acceleration * (total - done))
        now = min(now + acceleration * step, speed, max(braking - acceleration * step, 0.1))
        done = min(done + now * step, total)
        travelled.append(done)
    return np.array([*travelled, total, total])


def stroke_times(way: Place, pace: CylinderPace, step: float) -> Scalars:
    """Return how far (S,) a stroke of a way (2,) leads step by step: ever slower near its end."""
    total = float(np.hypot(*way))
    done, now, travelled = 0.0, 0.0, []
    while done < total:
        now = min(now + pace.speeding * step, pace.pushing, pace.slowing * (total + LEFT - done))
        done += now * step
        travelled.append(done)
    return np.array([*travelled, done])
