"""What is learned from: a push with the scenes before and after it, and where it came from.

A result has an identity, and a digest of what was seen. Two results with one identity or one
digest are the same push, whether it came live or from a recording.
"""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final, Self

import numpy as np

from sain_core.errors import ErrorCode, InvalidInputError, SainError
from sain_core.guarding.untrusted import LARGEST_NUMBER, MOST_BODIES
from sain_core.push import BODY, check_predictable
from sain_core.scene import POSITION, is_settled
from sain_core.shapes.bodies import PAPER_DISKS, Bodies, as_names, bodies_named
from sain_core.transitions import PushHistory
from sain_core.world import MOST_WAY, PushRecord

LONGEST_IDENTITY: Final = 256  # characters


@dataclass(frozen=True, eq=False)
class Result(PushRecord):
    """A push that was executed or refused, with what it was made on and when."""

    bodies: Bodies = PAPER_DISKS  # of the scenes
    # which one it belongs to, with its session; the next push of it begins where this one ended.
    # Empty: it stands alone
    episode: str = ""
    identity: str = ""  # of the push; empty: its digest
    object: str = ""  # the pushed body, as its user calls it; empty: `bodies` say what it is
    surface: str = ""  # what it stands on, likewise
    time: float = 0.0  # when it ended, seconds since 1970; 0: not known

    @cached_property
    def digest(self) -> str:
        """What was seen, as 32 hexadecimal digits."""
        arrays = (self.before, self.push, self.after)
        content = b"".join(np.ascontiguousarray(one, np.float64).tobytes() for one in arrays)
        names = "|".join((*as_names(self.own_bodies), self.object, self.surface))
        return hashlib.sha256(names.encode() + content).hexdigest()[:32]

    @property
    def own_bodies(self) -> Bodies:
        """The bodies of its scenes, as many as these have."""
        return self.bodies.fitted(len(self.before))

    def check(self) -> None:
        """Check that it can be learned from.

        Raises:
            SainError: the push was refused, or something that cannot be; the message says what.
        """
        if self.code != ErrorCode.OK:
            raise InvalidInputError(f"the push was refused: {_code_name(self.code)}")
        for name, text in (("episode", self.episode), ("identity", self.identity)):
            if len(text) > LONGEST_IDENTITY:
                raise InvalidInputError(
                    f"{name} has {len(text)} characters; allowed: {LONGEST_IDENTITY}"
                )
        history_of([self])  # has shapes and numbers that can be
        count = len(self.before)
        if count > MOST_BODIES or len(self.own_bodies) != count:
            allowed = min(MOST_BODIES, len(self.own_bodies))
            raise InvalidInputError(f"the scene has {count} bodies, not {allowed}")
        for name, scene in (("before", self.before), ("after", self.after)):
            if np.abs(scene).max() > LARGEST_NUMBER:
                raise InvalidInputError(f"scene {name} has a number above {LARGEST_NUMBER:g}")
            if not is_settled(scene):
                raise InvalidInputError(f"scene {name} was not at rest")
        check_predictable(self.push[None])
        if self.push[BODY] not in range(count):
            raise InvalidInputError(f"body {self.push[BODY]:g} was pushed; there are {count}")
        ways = np.hypot(*(self.after - self.before)[:, POSITION].T)
        if ways.max() > MOST_WAY:
            raise InvalidInputError(f"a body moved {ways.max():.3g} m; allowed: {MOST_WAY:g} m")

    def identified(self) -> Self:
        """Return it with an identity."""
        return self if self.identity else replace(self, identity=self.digest)

    def record(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        shapes, roles = as_names(self.own_bodies)
        content: dict[str, Any] = {
            "id": self.identity or self.digest,
            "digest": self.digest,
            "episode": self.episode,
            "time": self.time,
            "shapes": shapes,
            "roles": roles,
            "before": self.before.tolist(),
            "push": self.push.tolist(),
            "after": self.after.tolist(),
        }
        if self.noise is not None:
            content["noise"] = self.noise.tolist()
        return content | {
            name: value for name in ("object", "surface") if (value := getattr(self, name))
        }

    @classmethod
    def of_record(cls, record: Mapping[str, Any]) -> Self:
        """Return what `record` made.

        Raises `SainError`, `ValueError`, `LookupError` or `TypeError`: it was not.
        """
        before, push, after = (
            np.array(record[name], np.float64) for name in ("before", "push", "after")
        )
        noise = np.array(record["noise"], np.float64) if "noise" in record else None
        bodies = bodies_named(record["shapes"], record["roles"], len(before))
        found = cls(
            push,
            before,
            after,
            noise=noise,
            bodies=bodies,
            episode=str(record["episode"]),
            identity=str(record["id"]),
            object=str(record.get("object", "")),
            surface=str(record.get("surface", "")),
            time=float(record["time"]),
        )
        found.check()
        return found


def history_of(results: Sequence[Result]) -> PushHistory:
    """Return pushes of the same bodies and width as the history of an episode.

    Raises `InvalidInputError`: arrays of the wrong shape, or numbers that cannot be.
    """
    noise = None
    if any(one.noise is not None for one in results):
        zero = np.zeros(len(results[0].before))
        noise = np.stack([zero if one.noise is None else one.noise for one in results])
    columns = zip(*((one.before, one.push, one.after) for one in results), strict=True)
    before, push, after = map(np.stack, columns)
    return PushHistory(before, push, after, noise)


def _code_name(code: int) -> str:
    return ErrorCode(code).name if code in list(ErrorCode) else f"code {code}"


def why_not(result: Result) -> str:
    """Return why nothing can be learned from a result; empty: something can."""
    try:
        result.check()
    except SainError as error:
        return str(error)
    return ""
