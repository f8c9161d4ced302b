"""A push: one straight stroke of the tool against one body.

A push has five numbers: in arrays, messages, rows and files.

``body`` is the place in the scene of the body that is pushed; 0 is the paper's mid disk. The next
three are the paper's a in R^3. ``location`` lambda in (-pi, pi]: of a disk, world heading from the
contact point on the rim to the centre (0: the tool touches the -x side). ``angle`` psi in
[-pi/4, pi/4]: direction of travel relative to lambda. ``length`` L in [0, 0.15] m: the tool's
travel from its start pose, where its surface stands `PushLimits.clearance` off the contact point.
L = 0 moves nothing. ``speed`` in [0.01, 0.5] m/s: the tool's on its travel.

Against any other body, ``location`` names the contact point on its outline
(`sain_core.shapes.shape`), and ``angle`` is relative to the outline's inward normal there.

A stroke is a push that states itself where the tool goes: eleven numbers, for pushes as a robot
made them. Of any body, ``location + angle`` is the world heading of travel; `make_stroke` sets
angle 0. Then ``start_x`` and ``start_y`` [m], where the tool's axis begins, and ``tip_radius`` [m].
A tool may have a second disk: ``span_x`` and ``span_y`` [m] lead to its axis in the world, and are
0 otherwise. ``bar`` 1 joins the two disks by straight sides, 0 leaves two fingers. The tool does
not turn. Steep pushes, pushes at corners and pushes that miss are ordinary strokes. Models and data
sets take both widths; planners, the graph and the simulators take five numbers.
"""

from dataclasses import dataclass, fields
from functools import cache
from itertools import count
from math import pi
from secrets import randbits
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from numpy.typing import ArrayLike

from sain_core.config import Config, option
from sain_core.errors import ConfigError, InvalidInputError, OutOfRangeError
from sain_core.scene import POSITION, RADIUS, THETA, check_finite, turned, unit, wrap_angle
from sain_core.shapes.bodies import PAPER_DISKS, Bodies
from sain_core.shapes.shape import outlines_of
from sain_core.types import Angles, Indices, Points, PushArray, Pushes, Scalars, Scenes, States

BODY, LOCATION, ANGLE, LENGTH, SPEED = range(5)
PUSH_SIZE: Final = 5
PUSH_NAMES: Final = ("body", "location", "angle", "length", "speed")
START_X, START_Y, TIP_RADIUS, SPAN_X, SPAN_Y, BAR = range(PUSH_SIZE, PUSH_SIZE + 6)
STROKE_SIZE: Final = 11
STROKE_NAMES: Final = (*PUSH_NAMES, "start_x", "start_y", "tip_radius", "span_x", "span_y", "bar")
START: Final = slice(START_X, START_Y + 1)
SPAN: Final = slice(SPAN_X, SPAN_Y + 1)
PATH: Final = slice(LOCATION, LENGTH + 1)  # where the tool goes: location, angle, length
DEFAULT_SPEED: Final = 0.2  # [m/s], what every push had before pushes had a speed

TOOL_RADIUS: Final = 0.012  # [m], the cylindrical stick
MOST_SPAN: Final = 0.5  # [m], between the axes of a tool's two disks

RANDOM_BITS: Final = 32  # of a push id's start
COUNTER_BITS: Final = 20  # together below 2^53: exact also where numbers are doubles


def push_ids() -> "count[int]":
    """Return ids from a random start, a million apart from those of other senders."""
    return count((randbits(RANDOM_BITS) << COUNTER_BITS) + 1)


@dataclass(frozen=True)
class PushLimits(Config):
    """What a push may be. The simulator refuses all else."""

    max_angle: float = option(pi / 4, "largest |angle|", unit="rad", minimum=0.0, maximum=pi / 2)
    max_length: float = option(0.15, "longest travel", unit="m", minimum=0.0, maximum=0.5)
    clearance: float = option(
        0.005, "gap between tool and rim at the start", unit="m", minimum=0.0, maximum=0.05
    )
    tool_radius: float = option(
        TOOL_RADIUS, "radius of the stick", unit="m", minimum=0.001, maximum=0.05
    )
    min_speed: float = option(0.01, "slowest travel", unit="m/s", minimum=0.001, maximum=0.2)
    max_speed: float = option(0.5, "fastest travel", unit="m/s", minimum=0.2, maximum=2.0)
    speed: float = option(
        DEFAULT_SPEED, "travel where no other is asked for", unit="m/s", minimum=0.001, maximum=2.0
    )

    def __post_init__(self) -> None:
        """Check the fields, and that the default speed is allowed."""
        super().__post_init__()
        if not self.min_speed <= self.speed <= self.max_speed:
            raise ConfigError(f"speed is {self.speed} m/s; allowed: {self._speeds}")

    @property
    def _speeds(self) -> str:
        return f"[{self.min_speed}, {self.max_speed}] m/s"

    def check(self, push: PushArray, bodies: Bodies = PAPER_DISKS) -> PushArray:
        """Return the push when it is inside the limits, and against a pushable body.

        Raises `InvalidInputError`: shape, NaN or Inf; `OutOfRangeError`: a value outside its range.
        """
        if push.shape != (PUSH_SIZE,):
            raise InvalidInputError(
                f"a push has shape ({PUSH_SIZE},): {', '.join(PUSH_NAMES)}; not {push.shape}"
            )
        check_finite(push, PUSH_NAMES, "{name} of the push")
        ranges = (
            (LOCATION, np.nextafter(-pi, 0.0), pi, "rad", "(-pi, pi] (wrap it)"),
            (ANGLE, -self.max_angle, self.max_angle, "rad", f"+-{self.max_angle:.4f} rad"),
            (LENGTH, 0.0, self.max_length, "m", f"[0, {self.max_length}] m"),
            (SPEED, self.min_speed, self.max_speed, "m/s", self._speeds),
        )
        for column, low, high, name, allowed in ranges:
            if not low <= push[column] <= high:
                value = f"{_shown(push[column])} {name}"
                raise OutOfRangeError(f"push {PUSH_NAMES[column]} is {value}; allowed: {allowed}")
        body = push[BODY]
        if body not in bodies.pushable:
            allowed, known = ", ".join(map(str, bodies.pushable)), range(len(bodies))
            what = f"is {bodies.roles[int(body)]}" if body in known else "does not exist"
            raise OutOfRangeError(
                f"the push is against body {body:.15g}, which {what}; pushable are: {allowed}"
            )
        return push

    def sample(
        self, generator: np.random.Generator, count: int, speed: Scalars | None = None
    ) -> Pushes:
        """Draw pushes (count, 5) of body 0 uniformly: any side, any allowed angle and length."""
        location = generator.uniform(-pi, pi, count)
        angle = generator.uniform(-self.max_angle, self.max_angle, count)
        length = generator.uniform(0.0, self.max_length, count)
        speed = np.asarray(self.speed) if speed is None else speed
        return make_push(-location, angle, length, speed=speed)  # -[-pi, pi) is (-pi, pi]


def make_push(
    location: ArrayLike,
    angle: ArrayLike,
    length: ArrayLike,
    *,
    body: ArrayLike = 0,
    speed: ArrayLike = DEFAULT_SPEED,
) -> Pushes:
    """Return pushes (..., 5) of numbers, or of arrays that fit each other."""
    numbers = np.broadcast_arrays(body, location, angle, length, speed)
    return np.stack(numbers, axis=-1).astype(np.float64)


NO_SPAN: Final = np.zeros(2)  # of a tool of one disk


def make_stroke(
    start: Points,
    heading: ArrayLike,
    length: ArrayLike,
    *,
    body: ArrayLike = 0,
    speed: ArrayLike = DEFAULT_SPEED,
    tip_radius: ArrayLike = TOOL_RADIUS,
    span: Points = NO_SPAN,
    bar: ArrayLike = False,
) -> Pushes:
    """Return strokes (..., 11) from starts (..., 2) [m] in world headings (...,) [rad]."""
    numbers = (
        body, heading, 0.0, length, speed, start[..., 0], start[..., 1], tip_radius,
        span[..., 0], span[..., 1], bar,
    )  # fmt: skip
    return np.stack(np.broadcast_arrays(*numbers), axis=-1).astype(np.float64)


def is_stroke(pushes: ndarray) -> bool:
    """Return whether pushes state where the tool goes, in eleven numbers, not five."""
    width = pushes.shape[-1] if pushes.ndim else 0
    if width not in (PUSH_SIZE, STROKE_SIZE):
        raise InvalidInputError(
            f"a push has {PUSH_SIZE} numbers ({', '.join(PUSH_NAMES)}), a stroke {STROKE_SIZE}"
            f" ({', '.join(STROKE_NAMES[PUSH_SIZE:])} as well); not shape {pushes.shape}"
        )
    return width == STROKE_SIZE


def idle_pushes(*shape: int, size: int = PUSH_SIZE) -> Pushes:
    """Return pushes (*shape, size) that move nothing: of body 0, with length 0."""
    pushes = np.zeros((*shape, size))
    pushes[..., SPEED] = DEFAULT_SPEED
    pushes[..., TIP_RADIUS:SPAN_X] = TOOL_RADIUS
    return pushes


def check_predictable(pushes: Pushes) -> Pushes:
    """Return pushes that a model may be asked about: what `PushLimits` could allow, or any stroke.

    Raises `InvalidInputError`: another shape, NaN or Inf; `OutOfRangeError`: the first number that
    no arm's limits may allow.
    """
    stroke, finite = is_stroke(pushes), np.isfinite(pushes)
    if not finite.all():
        raise InvalidInputError(f"{_first(pushes, ~finite)}; it must be finite")
    for column, least, most in allowed_ranges(stroke):
        beyond = (pushes[..., column] < least) | (pushes[..., column] > most)
        if column == BAR:
            beyond |= pushes[..., column] % 1.0 != 0.0
        if beyond.any():
            wrong, to = np.zeros(pushes.shape, dtype=bool), "or" if column == BAR else "to"
            wrong[..., column] = beyond
            raise OutOfRangeError(f"{_first(pushes, wrong)}; allowed: {least:.4g} {to} {most:.4g}")
    return pushes


def action_ranges(last: int, limits: PushLimits = PushLimits()) -> tuple[PushArray, PushArray]:
    """Return the smallest and the largest action (5,) of who chooses pushes of bodies 0 to last."""
    low = [-0.5, -pi, -limits.max_angle, 0.0, limits.min_speed]
    high = [last + 0.5, pi, limits.max_angle, limits.max_length, limits.max_speed]
    return np.array(low), np.array(high)


def push_of(action: Any, last: int, limits: PushLimits = PushLimits()) -> PushArray:
    """Return the push (5,) that an action stands for: its body is rounded, up to the last one.

    A number in single or half precision that equals a limit rounded to that precision is the
    limit. The location -pi is pi.

    Raises `InvalidInputError`: no array of numbers, another shape, NaN or Inf;
    `OutOfRangeError`: a number outside its range.
    """
    low, high = action_ranges(last, limits)
    try:
        given = np.asarray(action)
    except (TypeError, ValueError, RuntimeError) as error:  # ragged, or a tensor that is no array
        raise InvalidInputError(f"the action is no array of numbers: {error}") from error
    if given.dtype.kind not in "fiu" or given.shape != low.shape:
        raise InvalidInputError(
            f"the action is an array of {given.dtype} with shape {given.shape}; needed:"
            f" numbers with shape {low.shape} ({', '.join(PUSH_NAMES)})"
        )
    push = given.astype(np.float64)
    check_finite(push, PUSH_NAMES, "{name} of the action")
    if given.dtype.kind == "f":
        for limit in (low, high):
            push = np.where(given == limit.astype(given.dtype), limit, push)
    wrong = (push < low) | (push > high)
    if wrong.any():
        column = int(np.argmax(wrong))
        raise OutOfRangeError(
            f"{PUSH_NAMES[column]} of the action is {push[column]:.9g}; allowed:"
            f" {low[column]:.6g} to {high[column]:.6g}"
        )
    if push[LOCATION] == -pi:
        push[LOCATION] = pi
    push[BODY] = min(np.floor(push[BODY] + 0.5), last)
    return push


@cache
def allowed_ranges(stroke: bool) -> tuple[tuple[int, float, float], ...]:
    """Return columns with the smallest and the largest value that any arm's limits may allow."""
    tools = [(column, -MOST_SPAN, MOST_SPAN) for column in (SPAN_X, SPAN_Y)] + [(BAR, 0.0, 1.0)]
    limits = {item.name: item.metadata for item in fields(PushLimits)}
    slowest, angle = limits["min_speed"]["minimum"], limits["max_angle"]["maximum"]
    tool = limits["tool_radius"]
    return (
        (TIP_RADIUS, tool["minimum"], tool["maximum"]) if stroke else (ANGLE, -angle, angle),
        (LENGTH, 0.0, limits["max_length"]["maximum"]),
        (SPEED, slowest, limits["max_speed"]["maximum"]),
        *(tools if stroke else ()),
    )


def _shown(value: float) -> str:
    return f"{value:.4f}" if abs(value) < 1e6 else f"{value:g}"


def _first(pushes: Pushes, wrong: ndarray) -> str:
    """Return the first wrong number of pushes in words."""
    *push, column = (int(index) for index in np.argwhere(wrong)[0])
    name = STROKE_NAMES[column]
    return f"{name} of push {tuple(push)} is {pushes[(*push, column)]}"


def pushed_bodies(pushes: Pushes) -> Indices:
    """Return which body each push (..., 5) is against, (...,)."""
    return pushes[..., BODY].astype(np.int64)


def push_direction(pushes: Pushes) -> Angles:
    """Return the world heading [rad] in which the tool travels against a disk, lambda + psi.

    Of a stroke, that against any body.
    """
    return wrap_angle(pushes[..., LOCATION] + pushes[..., ANGLE])


def strokes(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies = PAPER_DISKS
) -> tuple[Points, Angles]:
    """Return where the tool's axis stands before it travels, and the world heading of its travel.

    A stroke (..., 11) states both. In any other push (..., 5) of scenes (..., N, 8) it stands at
    the contact point, moved out along the normal by the tool's radius and the clearance.
    Places are (..., 2) [m], headings (...,) [rad].
    """
    if is_stroke(pushes):
        lead = np.broadcast_shapes(scenes.shape[:-2], pushes.shape[:-1])
        start = np.broadcast_to(pushes[..., START], (*lead, 2)).copy()
        return start, np.broadcast_to(push_direction(pushes), lead)
    state = _pushed_states(scenes, pushes)
    location, radius = pushes[..., LOCATION], state[..., RADIUS]
    # On a disk; the order of the sum keeps last bits as they always were.
    start = state[..., POSITION] - (radius + limits.tool_radius + limits.clearance)[
        ..., None
    ] * unit(location)
    heading = wrap_angle(location + pushes[..., ANGLE])
    if bodies.all_round:
        return np.asarray(start), heading
    outlines, pushed = outlines_of(bodies.shapes), pushed_bodies(pushes)
    places, inward = outlines.at(pushed, location)
    normal = wrap_angle(inward + state[..., THETA])
    contact = state[..., POSITION] + turned(radius[..., None] * places, state[..., THETA])
    away = (limits.tool_radius + limits.clearance) * unit(normal)
    is_round = outlines.is_round[pushed]
    start = np.where(is_round[..., None], start, contact - away)
    return start, np.where(is_round, heading, wrap_angle(normal + pushes[..., ANGLE]))


def tip_radii(pushes: Pushes, limits: PushLimits) -> Scalars:
    """Return the radius of the tool (...,) [m]: what a stroke states, else that of the limits."""
    if is_stroke(pushes):
        return np.asarray(pushes[..., TIP_RADIUS])
    return np.full(pushes.shape[:-1], limits.tool_radius)


def second_disks(pushes: Pushes) -> Float[ndarray, "*B 3"]:
    """Return the last three numbers of strokes: of a tool of one disk, as pushes have it, zeros."""
    return pushes[..., SPAN_X:] if is_stroke(pushes) else np.zeros((*pushes.shape[:-1], 3))


def as_strokes(
    scenes: Scenes, pushes: Pushes, limits: PushLimits, bodies: Bodies = PAPER_DISKS
) -> Pushes:
    """Return pushes as the strokes (..., 11) that move the tool in the same way."""
    start, heading = strokes(scenes, pushes, limits, bodies)
    return make_stroke(
        start,
        heading,
        pushes[..., LENGTH],
        body=pushes[..., BODY],
        speed=pushes[..., SPEED],
        tip_radius=tip_radii(pushes, limits),
        span=second_disks(pushes)[..., :2],
        bar=second_disks(pushes)[..., 2],
    )


def _pushed_states(scenes: Scenes, pushes: Pushes) -> States:
    """Return the states (..., 8) of the bodies that pushes are against."""
    lead = np.broadcast_shapes(scenes.shape[:-2], pushes.shape[:-1])
    all_states, pushed = np.broadcast_to(scenes, (*lead, *scenes.shape[-2:])), pushed_bodies(pushes)
    if pushed.size and (pushed == pushed.flat[0]).all():  # a fifth of the time of the other way
        return all_states[..., pushed.flat[0], :]
    body = np.broadcast_to(pushed, lead)[..., None, None]
    return np.take_along_axis(all_states, body, axis=-2)[..., 0, :]


def mirror_pushes(pushes: Pushes) -> Pushes:
    """Reflect pushes on disks, or strokes, in the x axis, as `mirror_scenes` does scenes."""
    mirrored = pushes.copy()
    mirrored[..., LOCATION] = wrap_angle(-pushes[..., LOCATION])
    mirrored[..., ANGLE] = -pushes[..., ANGLE]
    if is_stroke(pushes):
        mirrored[..., [START_Y, SPAN_Y]] = -pushes[..., [START_Y, SPAN_Y]]
    return mirrored


@dataclass(frozen=True)
class PaperGrid(Config):
    """The paper's discrete pushes (section III-B a): 5 locations x 7 angles x 3 lengths.

    The paper gives the counts and not the ranges; these are ours.
    """

    locations: int = option(5, "number of contact locations", minimum=1)
    angles: int = option(7, "number of push angles", minimum=1)
    lengths: tuple[float, ...] = option((0.05, 0.10, 0.15), "travels", unit="m", minimum=0.0)
    max_location: float = option(0.6, "largest |location|", unit="rad", minimum=0.0, maximum=pi)
    max_angle: float = option(pi / 4, "largest |angle|", unit="rad", minimum=0.0, maximum=pi / 2)

    def pushes(self) -> Pushes:
        """Return the whole grid, (105, 5) by default."""
        location = np.linspace(-self.max_location, self.max_location, self.locations)
        angle = np.linspace(-self.max_angle, self.max_angle, self.angles)
        grid = np.meshgrid(location, angle, np.asarray(self.lengths), indexing="ij")
        return make_push(*(axis.ravel() for axis in grid))
