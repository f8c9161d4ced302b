"""The state of the graph: the node writes it, the page shows it. Plain data.

Every attribute of `LiveState` is replaced and never changed in place, so that a reader on another
thread sees each as a whole and can tell by identity whether it is new.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from math import nan
from threading import Event
from typing import Any, Final, Self

import numpy as np
from jaxtyping import Float, UInt8
from numpy import ndarray

from sain_core.errors import ErrorCode
from sain_core.goal import Goal, Judgement
from sain_core.scene import POSITION
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.types import Pushes, Scene, Scenes
from sain_core.wire.learning import Learned
from sain_core.wire.scene_door import SeenScene
from sain_core.world import PushRecord

LOG_LINES: Final = 200  # that are kept
LONGEST_LINE: Final = 400  # characters of one
MOST_POINTS: Final = 400  # of a chart


FixedPose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


class Level(StrEnum):
    """What a line of the log is about."""

    NOTE = "note"
    REFUSAL = "refused"
    FAULT = "fault"


class Phase(StrEnum):
    """What the loop is doing."""

    WAITING = "waits for a scene"
    PAUSED = "paused"
    PLANNING = "planning"
    PUSHING = "pushing"
    REACHED = "goal reached"
    ENDED = "stopped"


@dataclass(frozen=True, eq=False)
class LivePlan:
    """A plan that sent a push.

    Attributes:
        push_id: of the push.
        start: (N, 8), the scene that it was planned from.
        pushes: (H, 3) or (H, 4).
        predicted: (H, N, 8), the scene after each.
        regions: (H, N) [m], radii that should hold each body; None: unknown.
        costs: (R,), of other sequences, from cheap to dear.
        places: (R, H, N, 2) [m], where these lead the bodies.
    """

    push_id: int
    start: Scene
    pushes: Pushes
    predicted: Scenes
    regions: Float[ndarray, "H N"] | None
    costs: Float[ndarray, "R"]
    places: Float[ndarray, "R H N 2"]


@dataclass(frozen=True)
class LogLine:
    """Something to read: when, in simulated seconds, what about, and the text."""

    time: float
    kind: Level
    text: str


@dataclass(frozen=True, eq=False)
class LiveCurves:
    """The charts of an episode, a number after each push, from none on; NaN: it is not known."""

    distance: tuple[float, ...] = ()  # [mm], largest distance of a body from its place in the goal
    planned: tuple[float, ...] = ()  # [mm], largest error of the planner's prediction
    physics: tuple[float, ...] = ()  # [mm], of the nominal physics
    planning: tuple[float, ...] = ()  # [ms], from settled scene to push

    @classmethod
    def of(cls, pushes: Sequence[PushRecord], distances: Sequence[float]) -> Self:
        """Return the charts of pushes; a distance [m] before the first, and after each."""
        return cls(
            tuple(1e3 * distance for distance in distances),
            (nan, *(largest_error(push, push.predicted) for push in pushes)),
            (nan, *(largest_error(push, push.physics) for push in pushes)),
            (nan, *(1e3 * push.planning_time or nan for push in pushes)),
        )


def largest_error(push: PushRecord, predicted: Scene | None) -> float:
    """Return the largest distance [mm] of a body from its prediction; NaN: it is not known."""
    if predicted is None or push.code != ErrorCode.OK or predicted.shape != push.after.shape:
        return nan
    apart = np.linalg.norm((predicted - push.after)[:, POSITION], axis=1)
    return 1e3 * float(apart.max())


@dataclass(frozen=True, eq=False)
class LiveArm:
    """The arm.

    Attributes:
        description: URDF.
        frames: pose (x y z, quaternion w x y z) of what is fixed in the world, by its name; where
            the root is not among them, it is the world.
    """

    description: str
    frames: Mapping[str, FixedPose] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GhostLine:
    """A line (M, 3) [m] where the arm will go, with its width [m] and colour."""

    points: Float[ndarray, "M 3"]
    width: float
    colour: tuple[int, int, int]


@dataclass(eq=False)
class LiveState:
    """The whole state. `changed` is set after each change, `log` is appended to."""

    scene: SeenScene | None = None
    epoch: float = 0.0  # [s], of the clock in the scenes, when the page heard the first of them
    bodies: Bodies = PAPER_DISKS
    aim: Goal | None = None
    plan: LivePlan | None = None
    result: PushRecord | None = None  # of the last push
    arm: LiveArm | None = None
    ghost: tuple[GhostLine, ...] = ()  # the way of the push that the arm plans or makes
    picture: UInt8[ndarray, "H W 3"] | None = None  # of the camera, with what was found
    joints: Mapping[str, float] = field(default_factory=dict)
    curves: LiveCurves = LiveCurves()
    learned: Learned | None = None  # by the learner of a laboratory; None: there is none
    learns: bool | None = None  # whether it learns from pushes now; None: it does not answer
    phase: Phase = Phase.WAITING
    why: str = ""  # it is in this phase
    pushes: int = 0  # sent for the goal
    followed: bool = False  # whether goals are sent as they are dragged
    model: str = ""  # that is served
    loading: str = ""  # model that is to replace it
    starting: str = ""  # what the graph still waits for
    engine: str = ""
    world: str = ""
    planner: Mapping[str, Any] = field(default_factory=dict)  # parameters of the planner's node
    log: "deque[LogLine]" = field(default_factory=lambda: deque(maxlen=LOG_LINES))
    lines: int = 0  # ever logged
    changed: Event = field(default_factory=Event)

    def update(self, **values: Any) -> None:
        """Replace the values of these names."""
        for name, value in values.items():
            setattr(self, name, value)
        self.changed.set()

    @property
    def time(self) -> float:
        """The time [s] of the latest scene: simulated, or of a robot since the page listens."""
        return 0.0 if self.scene is None else self.scene.stamp - self.epoch

    def judge(self, scene: Scene) -> Judgement | None:
        """Judge a scene; None: there is no goal, or the scene is of another."""
        aim, bodies, count = self.aim, self.bodies, len(scene)
        if aim is None or len(bodies) != count or max(aim.wanted) >= count:
            return None
        return aim.judge(scene, scene, bodies)

    def tell(self, kind: Level, text: str) -> None:
        """Add a line to the log; the same one again is not repeated."""
        text = " ".join(text.split())
        text = text if len(text) <= LONGEST_LINE else text[: LONGEST_LINE - 1] + "…"
        if self.log and (self.log[-1].kind, self.log[-1].text) == (kind, text):
            return
        self.log.append(LogLine(self.time, kind, text))
        self.lines += 1
        self.changed.set()
