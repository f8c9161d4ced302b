"""Codecs of `rosetta` 0.2 for our messages, named by ``sain_bringup/config/rosetta.yaml``.

They give the numbers that ``to_dataset --format lerobot`` writes under the same key. Source:
https://github.com/iblnkn/rosetta, doc/reference/contract.md.
"""

from typing import Any, Final

from numpy import ndarray

from sain_core import wire
from sain_core.errors import InvalidInputError
from sain_core.goal import OBSERVED
from sain_core.push import push_ids
from sain_core.ros import codec
from sain_core.scene import STATE_SIZE
from sain_interfaces.msg import Push, Scene

SOURCE: Final = "rosetta"

_ids = push_ids()
_seen: list[Scene] = []  # the latest scene: rosetta's encoders are given an action and no more


def decode_state(message: Any, spec: Any) -> ndarray:
    """Return the numbers (8 N,) of a ``Scene`` with as many bodies as the contract selects."""
    state = wire.decode_scene(message).ravel()
    if len(state) != len(spec.names):
        raise InvalidInputError(
            f"the scene has {len(state) // STATE_SIZE} bodies; the contract selects"
            f" {len(spec.names)} numbers, {STATE_SIZE} of each body: adapt it to the scene"
        )
    _seen[:] = [message]
    return state


def decode_goal(message: Any, spec: Any) -> ndarray:
    """Return what a ``Goal`` asks of each body (5 N,), as `OBSERVED`."""
    count = len(spec.names) // len(OBSERVED)
    return wire.decode_goal(message).fitted(count).observed(count).ravel()


def decode_push(message: Any, spec: Any) -> ndarray:
    """Return the numbers (5,) of a ``Push``."""
    return wire.decode_push(message)


def encode_push(action: ndarray, spec: Any, stamp_ns: int | None = None) -> Push:
    """Return a push (5,) from the scene that `decode_state` saw last.

    Raises `InvalidInputError`: it saw none.
    """
    if not _seen:
        raise InvalidInputError("no scene was decoded yet, and a push names the one it starts from")
    return codec.encode_push(
        action,
        stamp=codec.encode_time(stamp_ns or 0),
        push_id=next(_ids),
        episode_id=_seen[0].episode_id,
        scene_id=_seen[0].scene_id,
        source=SOURCE,
    )
