"""The YAML file that states what a camera cannot see: shape, role, radius and mass of each body."""

from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from sain_core.errors import ConfigError, UntrustedFileError
from sain_core.guarding.untrusted import (
    LEAST_RADIUS,
    LONGEST_NAME,
    MOST_BODIES,
    MOST_RADIUS,
    read_yaml,
)
from sain_core.scene import NOMINAL_MASS, POSE, make_scene
from sain_core.shapes.bodies import Bodies
from sain_core.types import Scene

Poses = Float[ndarray, "N 3"]  # x, y [m], heading [rad]

KEYS: Final = ("name", "shape", "role", "radius", "mass", "frame")
NEEDED: Final = ("shape", "radius")
UNKNOWN: Final = "unknown"
MOST_MASS: Final = 100.0  # [kg]


@dataclass(frozen=True)
class BodyFile:
    """What is known of the bodies on a table, in the order of its scenes.

    Attributes:
        bodies: shapes and roles.
        names: for messages.
        radii: [m], as in a scene.
        masses: [kg]; nominal where unknown.
        frames: on ``/tf``; none: poses come as an array in this order.
        weighed: whether all masses are known.
    """

    bodies: Bodies
    names: tuple[str, ...]
    radii: tuple[float, ...]
    masses: tuple[float, ...]
    frames: tuple[str, ...]
    weighed: bool

    def scene(self, poses: Poses) -> Scene:
        """Return bodies at rest (N, 8) at poses (N, 3)."""
        scene = make_scene(poses[:, :2], np.array(self.masses), np.array(self.radii))
        scene[:, POSE] = poses
        return scene

    def called(self, body: int) -> str:
        """Return what a body is called in messages."""
        return f"body {body} ({self.names[body]})"


def read_bodies(path: Path) -> BodyFile:
    """Return the bodies that a YAML file states.

    Raises:
        ConfigError: naming the file, the body and what is wrong.
    """
    try:
        content = read_yaml(path)
    except OSError as error:
        raise ConfigError(f"bodies file {path}: {error.strerror or error}") from error
    except UntrustedFileError as error:
        raise ConfigError(f"bodies file {path} is not read: {error}") from error
    try:
        return parse_bodies(content)
    except ConfigError as error:
        raise ConfigError(f"bodies file {path}: {error}") from error


def parse_bodies(content: Any) -> BodyFile:
    """Return the bodies that the content of a file states; raises as `read_bodies`."""
    rows = content.get("bodies") if isinstance(content, Mapping) else None
    if not isinstance(rows, list) or not 1 <= len(rows) <= MOST_BODIES:
        raise ConfigError(f"it must have a list 'bodies' of 1 to {MOST_BODIES} bodies")
    for number, row in enumerate(rows):
        _check_keys(row, f"body {number}")
    frames = [_text(row, "frame", number) for number, row in enumerate(rows)]
    if any(frames) and not all(frames):
        raise ConfigError(
            f"body {frames.index('')} has no frame and others have; give all a frame on /tf, or"
            " none, and poses come as a PoseArray in this order"
        )
    for frame in frames:
        if frame and frames.count(frame) > 1:
            raise ConfigError(f"two bodies have the frame {frame!r}; each needs its own")
    shapes = [_text(row, "shape", number) for number, row in enumerate(rows)]
    roles = [_text(row, "role", number) for number, row in enumerate(rows)]
    if any(roles) and not all(roles):
        raise ConfigError(f"body {roles.index('')} has no role and others have; give all or none")
    names = [_text(row, "name", number) or shapes[number] for number, row in enumerate(rows)]
    masses = [_mass(row.get("mass", UNKNOWN), number) for number, row in enumerate(rows)]
    return BodyFile(
        Bodies.named(shapes, roles if all(roles) else ()),
        tuple(names),
        tuple(
            _number(row["radius"], f"radius of body {number}", "m", LEAST_RADIUS, MOST_RADIUS)
            for number, row in enumerate(rows)
        ),
        tuple(NOMINAL_MASS if mass is None else mass for mass in masses),
        tuple(frames) if all(frames) else (),
        None not in masses,
    )


def _check_keys(row: Any, body: str) -> None:
    if not isinstance(row, Mapping):
        raise ConfigError(f"{body} is {row!r}; it must have keys: {', '.join(KEYS)}")
    for key in row:
        if key not in KEYS:
            near = get_close_matches(str(key), KEYS, n=1)
            hint = f" (did you mean {near[0]!r}?)" if near else ""
            raise ConfigError(f"{body} has the key {key!r}{hint}; allowed: {', '.join(KEYS)}")
    for key in NEEDED:
        if key not in row:
            raise ConfigError(f"{body} has no {key}; it needs {' and '.join(NEEDED)}")


def _text(row: Mapping[str, Any], key: str, body: int) -> str:
    value = row.get(key, "")
    if not isinstance(value, str) or len(value) > LONGEST_NAME:
        raise ConfigError(
            f"{key} of body {body} is {str(value)[:LONGEST_NAME]!r}; it must be a text of at most"
            f" {LONGEST_NAME} characters"
        )
    return value


def _mass(value: Any, body: int) -> float | None:
    if value == UNKNOWN:
        return None
    return _number(value, f"mass of body {body}", "kg", 0.001, MOST_MASS)


def _number(value: Any, what: str, unit: str, low: float, high: float) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and isfinite(value) and low <= value <= high):
        raise ConfigError(f"{what} is {value!r}; allowed: {low:g} to {high:g} {unit}")
    return float(value)
