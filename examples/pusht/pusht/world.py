"""gym-pusht as a world: strokes of its disk, and what they lead to."""

from typing import Any, Final

import numpy as np
import shapely

from pusht.block import DISK, MIDDLE, PIXEL, WALLS, Block, T, pixels
from pusht.motion import Room, Servo, direction, plan_motion
from sain_core.errors import ConfigError, InvalidInputError, UnreachableError
from sain_core.push import LENGTH, SPEED, PushLimits, strokes
from sain_core.scene import MASS, RADIUS, unit
from sain_core.world import DivergedError, Outcome, Setting

MOST_STEPS: Final = 300  # gym-pusht's own limit
OVERLAP: Final = 0.3  # [px], of things that touch: gym-pusht's solver leaves a tenth of this
STILL: Final = 1e-4  # [m] and [rad], that a block moves by at most in a step once it rests
LONGEST_REST: Final = 10  # steps to wait for that
PUSHED: Final = 80.0  # [px], from the disk to its target while it comes out of a corner
HURRY: Final = 2.0  # how far beyond a place its target is, so that the disk gets there soon
SAME: Final = 1e-9  # [m] and [rad]
FIRST: Final = 0.1  # friction of episode 0; see `friction_of`
NEXT: Final = 1e-6  # more for each seed
MOST_SEED: Final = 999_999


def friction_of(seed: int) -> float:
    """Return the friction that names the episode of a seed.

    gym-pusht draws block and disk from a seed, and a `Setting` has no place for the disk. There is
    no friction with the table in gym-pusht, so this number is free to say where the disk begins.

    Raises:
        InvalidInputError: a seed that is too large for that.
    """
    if not 0 <= seed <= MOST_SEED:
        raise InvalidInputError(f"the seed of gym-pusht is {seed}; allowed: 0 to {MOST_SEED}")
    return FIRST + NEXT * seed


def make_env() -> Any:
    """Return gym-pusht's environment as its authors made it.

    Raises:
        ConfigError: it is not installed, or cannot be loaded.
    """
    try:
        import gymnasium
        import gym_pusht  # noqa: F401  # isort: skip  (registers the environment)
    except ImportError as error:
        install = "pip install '.[pusht]' in the checkout of SAIN"
        raise ConfigError(f"gym-pusht cannot be imported ({error}); {install}") from error
    return gymnasium.make("gym_pusht/PushT-v0").unwrapped


class DiskWorld:
    """Executes strokes of the disk of an environment.

    Attributes:
        env: the environment.
        servo: the controller of its disk.
        block: in it.
        room: of its disk.
        steps: of control in this episode; its time is a tenth of a second each.
        most: steps of an episode.
        done: whether the episode was a success.
    """

    name: str  # in errors
    env: Any
    servo: Servo
    most: int

    def __init__(self, block: Block, disk: float) -> None:
        """Begin no episode yet, with a block and the radius [px] of the disk."""
        self.block, self.room = block, Room(disk)
        self.steps = self._timed = 0  # those in the outcomes of pushes
        self.done = False
        self._refused = False
        self._mass = 1.0

    @property
    def motion(self) -> np.ndarray:
        """The place and the velocity (2, 2) [px, px/s] of the disk."""
        return np.array([self.env.agent.position, self.env.agent.velocity])

    def observe(self) -> np.ndarray:
        """Return the scene (1, 8) as it is."""
        return self._scene.copy()

    def push(self, push: np.ndarray, *, seen: np.ndarray | None = None) -> Outcome:
        """Execute a push, or as much of it as there are steps.

        Raises:
            UnreachableError: the disk cannot get to where the push starts; nothing has moved.
            DivergedError: no steps are left.
        """
        before = self.observe()
        if push[LENGTH] > 0.0:
            self._refused = True
            targets = self._targets(push, before if seen is None else seen)
            self._refused = False
            if self._follow(targets):
                self._part()
                self._come_out()
        took, self._timed = self.steps - self._timed, self.steps
        return Outcome(before, self.observe(), took * self.servo.period)

    def _targets(self, push: np.ndarray, scene: np.ndarray) -> np.ndarray:
        if self.done or self.steps >= self.most:
            raise DivergedError(f"{self.name} ends an episode after {self.most} steps")
        limits = PushLimits(tool_radius=self.room.disk * PIXEL)
        place, heading = strokes(scene, push, limits, self.block.bodies)
        ends = pixels(np.stack([place, place + push[LENGTH] * unit(heading)]))
        if not self.room.contains(ends).all():
            raise UnreachableError(f"the tool would go into a wall of {self.name}")
        speed = push[SPEED] / PIXEL
        return plan_motion(self.servo, self.room, self.motion, *ends, speed, self._outline)

    @property
    def _outline(self) -> np.ndarray:
        """The block's corners (M, 2) [px]."""
        return pixels(self.block.shape.placed(self._scene[0]))

    def _follow(self, targets: np.ndarray) -> bool:
        """Let the disk follow targets (S, 2); return whether the episode goes on."""
        return all(self._step(target) for target in targets)

    def _part(self) -> None:
        """Let what overlaps part: the disk leaves the block, walls push the block out."""
        for _ in range(LONGEST_REST):
            outline, place = self._outline, self.motion[0]
            block, before = shapely.Polygon(outline), self.observe()
            apart = block.distance(shapely.Point(place)) - self.room.disk > -OVERLAP
            inside = (outline >= WALLS[0] - OVERLAP) & (outline <= WALLS[1] + OVERLAP)
            if apart and inside.all():
                return
            outside = self.room.nearest_outside(place, block)
            if not self._step(place + HURRY * (outside - place)):
                return
            if apart and np.abs(self._scene - before).max() < STILL:
                return

    def _come_out(self) -> None:
        """Let the disk push the block away that shuts it off in a corner of the room."""
        for moved in range(LONGEST_REST):
            place = self.motion[0]
            if not self.room.shut_off(place[None], self._outline[None])[0]:
                if moved and self._step(place):  # at rest
                    self._part()
                return
            if not self._step(place + PUSHED * direction(place, np.full(2, MIDDLE))):
                return

    def _step(self, target: np.ndarray) -> bool:
        """Move the disk for a step of control; return whether the episode goes on."""
        _, _, success, _, _ = self.env.step(target)
        self.steps += 1
        self._note()
        self.done = bool(success)
        return not success and self.steps < self.most

    def _note(self) -> None:
        pose = [*self.env.block.position, self.env.block.angle]
        self._scene = self.block.scene_of(np.array(pose), self._mass)


class PushtWorld(DiskWorld):
    """Executes pushes of the T of gym-pusht."""

    name = "gym-pusht"

    def __init__(self) -> None:
        """Make the environment."""
        super().__init__(T, DISK)
        self.env = make_env()
        self.servo, self.most = Servo.of(self.env), MOST_STEPS

    def reset(self, start: Setting) -> np.ndarray:
        """Begin an episode; return its first scene (1, 8).

        After a push that was refused, the episode goes on if the scene is the same.

        Raises:
            InvalidInputError: another body than the T, or another size.
        """
        shape, radius = start.bodies.shapes[0].name, start.scene[0, RADIUS]
        if len(start.scene) != 1 or shape != T.shape.name or abs(radius - T.radius) > SAME:
            raise InvalidInputError(
                f"the first of {len(start.scene)} bodies is {shape!r} with radius {radius:.4f} m;"
                f" gym-pusht has one {T.shape.name!r} with radius {T.radius:.4f} m:"
                " use --scenario gym-pusht"
            )
        goes_on, self._refused = self._refused, False
        if goes_on and np.array_equal(start.scene, self._scene):
            return self.observe()
        self.begin(abs(round((start.friction - FIRST) / NEXT)))
        self._mass = float(start.scene[0, MASS])
        if not np.allclose(self._scene[0, :MASS], start.scene[0, :MASS], rtol=0.0, atol=SAME):
            x, y, angle = T.pose_of(start.scene).tolist()
            self.env.block.angle = angle  # first: the block turns about its centre of mass
            self.env.block.position = x, y
        self._scene = start.scene.copy()
        return self.observe()

    def begin(self, seed: int) -> np.ndarray:
        """Begin gym-pusht's episode of a seed; return its first scene (1, 8).

        Where block and disk or walls overlap at first, they part before anything else: steps that
        count.
        """
        self.env.reset(seed=seed)
        self.steps, self._timed, self._mass, self.done = 0, 0, 1.0, False
        self._note()
        self._part()
        return self.observe()


def load(name: str) -> PushtWorld:
    """Return the world; the entry point in `pyproject.toml` leads here."""
    return PushtWorld()
