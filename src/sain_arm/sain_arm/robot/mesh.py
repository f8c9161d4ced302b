"""Reads the convex hull of a mesh: MuJoCo collides with no more of it.

STL, binary and as text, and OBJ. MuJoCo itself reads no STL as text, and stops at 200,000 faces.
"""

import re
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull, QhullError

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import MIB, read_regular

Corners = Float[ndarray, "V 3"]

MESH_BYTES: Final = 64 * MIB
HEADER: Final = 84  # bytes of a binary STL, with the count of triangles at its end
TRIANGLE: Final = np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("more", "<u2")])
TEXT_STL: Final = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
OBJ: Final = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
FLAT: Final = 1e-6  # thickness over width
FARTHEST: Final = 1e9  # in the unit of the file


def mesh_corners(path: Path) -> Corners:
    """Return the corners (V, 3) of the triangles of a mesh, in the unit of its file.

    Raises:
        UntrustedFileError: it is no STL or OBJ, has NaN, or encloses nothing.
        OSError: it does not exist, or cannot be read.
    """
    return _corners(path, path.stat().st_mtime_ns)


def mesh_hull(path: Path) -> Corners:
    """Return the corners (V, 3) of the convex hull of a mesh; raises as `mesh_corners`."""
    return _hull(path, path.stat().st_mtime_ns)


@lru_cache(maxsize=128)
def _hull(path: Path, time: int) -> Corners:
    corners = _corners(path, time)
    rows = corners.view(
        np.dtype((np.void, corners.strides[0]))
    )  # np.unique of rows takes 4 times as long
    corners = np.unique(rows).view(np.float64).reshape(-1, 3)
    try:
        return corners[ConvexHull(corners).vertices]
    except QhullError as error:
        raise UntrustedFileError("it has no convex hull: it is nearly flat") from error


@lru_cache(maxsize=128)
def _corners(path: Path, time: int) -> Corners:
    content, kind = read_regular(path, MESH_BYTES), path.suffix.lower()
    if kind == ".obj":
        corners = _from_text(OBJ.findall(content))
    elif kind == ".stl":
        corners = _stl(content)
    else:
        raise UntrustedFileError(
            f"a collision mesh must be .stl or .obj; convert it: assimp export {path.name}"
            f" {path.stem}.stl"
        )
    if not len(corners):
        raise UntrustedFileError("it has no corners")
    if not (np.abs(corners) < FARTHEST).all():
        raise UntrustedFileError(f"a corner has NaN, or a number beyond {FARTHEST:g}")
    spread = np.linalg.eigvalsh(np.cov(corners.T)) if len(corners) > 3 else np.zeros(3)
    if not spread[0] > FLAT**2 * spread[2]:
        raise UntrustedFileError("all its corners lie in one plane; it must enclose a volume")
    corners.flags.writeable = False
    return corners


def _stl(content: bytes) -> Corners:
    count = int.from_bytes(content[HEADER - 4 : HEADER], "little")
    size = HEADER + count * TRIANGLE.itemsize
    is_text = content.lstrip()[:5].lower() == b"solid"
    if len(content) == size or (not is_text and count and len(content) > size):
        rows = np.frombuffer(content, TRIANGLE, count, HEADER)
        return rows["corners"].reshape(-1, 3).astype(np.float64)
    if is_text:
        return _from_text(TEXT_STL.findall(content))
    raise UntrustedFileError(
        f"it is no STL: its header states {count:,} triangles, which are {size:,} bytes; it has"
        f" {len(content):,}"
    )


def _from_text(rows: list[tuple[bytes, bytes, bytes]]) -> Corners:
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise UntrustedFileError(f"a corner is no number ({error})") from error
