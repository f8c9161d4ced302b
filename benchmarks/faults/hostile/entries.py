"""What the three nodes take: valid messages, and those that no honest sender sends.

`hostile` makes the latter from the fields that a message class declares.
"""

import re
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import PoseStamped

from sain_core.goal import Goal
from sain_core.push import PUSH_NAMES, idle_pushes
from sain_core.ros import codec
from sain_core.scene import make_scene
from sain_core.shapes.bodies import Bodies as CoreBodies
from sain_interfaces import action, msg, srv

PACKAGES: Final = {"sim_node": "sain_sim", "model_node": "sain_model", "mppi_node": "sain_mppi"}
SCENE: Final = make_scene(
    np.array([(0.40, 0.0), (0.541, 0.0)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)
FLOATS: Final = (float("nan"), float("inf"), float("-inf"), 1e308, -1e308)
TEXTS: Final = ("../../etc/passwd", "%s%n", "\x1b[31m\n", "☠" * 30, "x" * 65, "x" * 100_000)
LENGTHS: Final = (11, 100, 1000, 20_000)
CHANCES: Final = (0.4, 0.4, 0.17, 0.03)  # of the lengths: long ones take long to send
INTEGERS: Final = {f"uint{bits}": 2**bits - 1 for bits in (8, 16, 32, 64)} | {
    f"int{bits}": 2 ** (bits - 1) - 1 for bits in (8, 16, 32, 64)
}
UNREAD: Final = {"heading", "heading_tolerance"}  # of a pose, without has_heading
SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, (\d+))?>")


@dataclass(frozen=True)
class Entry:
    """What a node takes, a valid message for it, and the fields whose wrong values are fatal."""

    node: str
    name: str
    kind: Any
    valid: Any
    fatal: tuple[str, ...]
    text: str = ""  # the field that takes text of 10 MB


def entries() -> list[Entry]:
    """Return all entries of the three nodes."""
    disks, stamp = codec.encode_disks(SCENE), codec.encode_time(0)
    past = {"past": 0}
    asked = {"scene": codec.encode_floats(SCENE), "pushes": codec.encode_floats(idle_pushes(4))}
    rollout = srv.Rollout.Request(samples=2, horizon=2, disks=2, **past, **asked)
    predict = srv.PredictResidual.Request(batch=1, disks=2, **past)
    predict.scenes, predict.pushes = asked["scene"], codec.encode_floats(idle_pushes())
    scene = codec.encode_scene(SCENE, stamp=stamp, episode_id=1, scene_id=1, settled=True)
    two = CoreBodies.named(("disk", "t"), ())
    bodies = codec.encode_bodies(two, (0.08, 0.06), stamp=stamp, episode_id=1)
    goal = codec.encode_goal(Goal.place(0.7, 0.0), stamp=stamp, goal_id=1)
    push = msg.Push(episode_id=1, scene_id=1, length=0.1, source="flood", disks=disks)
    result = msg.PushResult(push=push, before=scene, after=scene, episode_id=1, push_id=1)
    sizes = ("disks", "scene", "pushes", "shapes", "roles", "past", "past_scenes")
    reset = ("disks", "shapes", "roles", "world", "friction")
    aims = ("poses", "keep")
    sim, model, mppi = PACKAGES
    return [
        Entry(sim, "push", msg.Push, push, (*PUSH_NAMES, "disks"), "source"),
        Entry(
            sim, "reset_scene", srv.ResetScene, srv.ResetScene.Request(disks=disks), reset, "world"
        ),
        Entry(model, "rollout", srv.Rollout, rollout, ("samples", "horizon", *sizes), "roles"),
        Entry(
            model, "predict_residual", srv.PredictResidual, predict, ("batch", "scenes"), "shapes"
        ),
        Entry(model, "load_model", srv.LoadModel, srv.LoadModel.Request(), ("model",), "model"),
        Entry(model, "describe_model", srv.DescribeModel, srv.DescribeModel.Request(), ()),
        Entry(mppi, "scene", msg.Scene, scene, ("disks",), "header"),
        Entry(mppi, "shapes", msg.Bodies, bodies, ("bodies",), "header"),
        Entry(mppi, "goal", msg.Goal, goal, aims, "header"),
        Entry(mppi, "goal_pose", PoseStamped, PoseStamped(), ("pose",), "header"),
        Entry(mppi, "push_result", msg.PushResult, result, ("before", "after"), "error_message"),
        Entry(mppi, "reach", action.Reach, action.Reach.Goal(goal=goal), ("goal",)),
    ]


def hostile(valid: Any, fatal: Sequence[str], random: np.random.Generator) -> Any:
    """Return a copy of a message with one of the fatal fields spoilt, and up to two others."""
    message = deepcopy(valid)
    kinds = message.get_fields_and_field_types()
    names = list(kinds)
    chosen = [str(random.choice(list(fatal)))] if fatal else []
    chosen += [str(name) for name in random.choice(names, random.integers(3))] if names else []
    for name in dict.fromkeys(chosen):
        if name not in fatal and name.endswith("_id"):
            continue  # of the push or goal that the answer names
        setattr(message, name, spoilt(getattr(message, name), kinds[name], random))
    return message


def spoilt(value: Any, kind: str, random: np.random.Generator) -> Any:
    """Return another value for a field of this type, which should be refused."""
    if found := SEQUENCE.fullmatch(kind):
        return _spoilt_sequence(list(value), found[1], random)[: int(found[2] or LENGTHS[-1])]
    if kind in ("double", "float"):
        return float(random.choice(FLOATS if kind == "double" else FLOATS[:3]))
    if kind == "boolean":
        return not value
    if kind.startswith("string"):
        return TEXTS[random.integers(len(TEXTS))]
    if kind in INTEGERS:
        return INTEGERS[kind]
    if hasattr(value, "get_fields_and_field_types"):
        inner = value.get_fields_and_field_types()
        name = str(random.choice(sorted(inner.keys() - UNREAD)))
        setattr(value, name, spoilt(getattr(value, name), inner[name], random))
    return value


def _spoilt_sequence(values: list[Any], kind: str, random: np.random.Generator) -> list[Any]:
    """Return a sequence with one spoilt element, or one that is much too long."""
    if values and random.uniform() < 0.5:
        place = int(random.integers(len(values)))
        values[place] = spoilt(deepcopy(values[place]), kind, random)
        return values
    if kind in INTEGERS or kind.startswith("string"):
        element: Any = INTEGERS.get(kind, "disk")
    else:
        element = 0.5 if kind in ("double", "float") else None
    if element is None:
        element = values[0] if values else _default(kind)
    return [element] * int(random.choice(LENGTHS, p=CHANCES))


def _default(kind: str) -> Any:
    package, name = kind.split("/")
    return getattr(__import__(f"{package}.msg", fromlist=[name]), name)()
