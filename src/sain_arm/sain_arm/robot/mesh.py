"""Reads the convex hull of a mesh: MuJoCo collides with no more of it.

STL, binary and as text, OBJ, and COLLADA (DAE), whose unit counts and whose up axis does not, as in
RViz. MuJoCo itself reads no STL as text and no DAE, and stops at 200,000 faces.
"""

import re
from functools import lru_cache
from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from sain_arm.robot.urdf_file import tree_of
from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import MIB, one_line, read_regular

Corners = Float[ndarray, "V 3"]

MESH_BYTES: Final = 64 * MIB
HEADER: Final = 84  # bytes of a binary STL, with the count of triangles at its end
TRIANGLE: Final = np.dtype([("normal", "<3f4"), ("corners", "<9f4"), ("more", "<u2")])
TEXT_STL: Final = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
TEXT_STL_END: Final = re.compile(rb"\bendsolid\b[^\n]*\s*\Z", re.IGNORECASE)
FACET: Final = re.compile(rb"\bendfacet\b", re.IGNORECASE)
OBJ: Final = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
OBJ_FACE: Final = re.compile(rb"^[ \t]*[fl][ \t]", re.MULTILINE)
FLAT: Final = 1e-6  # thickness over width
AGAIN: Final = "it was cut off, or damaged; get it again"
FARTHEST: Final = 1e9  # in the unit of the file


def mesh_corners(path: Path) -> Corners:
    """Return the corners (V, 3) of the triangles of a mesh, in the unit of its file.

    Raises:
        UntrustedFileError: it is no STL, OBJ or DAE, has NaN, or encloses nothing.
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
        if len(corners) and not OBJ_FACE.search(content):
            raise UntrustedFileError(f"it has corners and no face; {AGAIN}")
    elif kind == ".stl":
        corners = _stl(content)
    elif kind == ".dae":
        corners = _collada(content)
    else:
        raise UntrustedFileError(
            f"a collision mesh must be .stl, .obj or .dae; convert it: assimp export {path.name}"
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
        return _stl_text(content)
    raise UntrustedFileError(
        f"it is no STL: its header states {count:,} triangles, which are {size:,} bytes; it has"
        f" {len(content):,}"
    )


def _stl_text(content: bytes) -> Corners:
    corners, facets = _from_text(TEXT_STL.findall(content)), len(FACET.findall(content))
    if not TEXT_STL_END.search(content):
        raise UntrustedFileError(f"it does not end with endsolid; {AGAIN}")
    if len(corners) != 3 * facets:
        raise UntrustedFileError(
            f"its {facets:,} facets have {len(corners):,} corners, not 3 each; {AGAIN}"
        )
    return corners


def _collada(content: bytes) -> Corners:
    """Return the corners of the geometries of a scene, where its nodes place them."""
    root = tree_of(content.decode(errors="replace"))
    shapes = {shape.get("id"): _positions(shape) for shape in root.iter("geometry")}
    unit = root.find("asset/unit")
    scale = 1.0 if unit is None else float(_row(unit.get("meter", "1"), 1)[0])
    found, places = [np.empty((0, 3))], [(scene, np.eye(4)) for scene in root.iter("visual_scene")]
    while places:
        node, place = places.pop()
        for part in node:
            if part.tag in NODE_MOVES:
                place = place @ NODE_MOVES[part.tag](part.text or "")
            elif part.tag == "node":
                places.append((part, place))
            elif part.tag == "instance_geometry":
                corners = shapes.get(part.get("url", "").removeprefix("#"), found[0])
                found.append(corners @ place[:3, :3].T + place[:3, 3])
            elif part.tag in ("instance_node", "instance_controller"):
                raise UntrustedFileError(f"it has <{part.tag}>, which is not read")
    return scale * np.concatenate(found)


def _positions(shape: Element) -> Corners:
    """Return the corners of a geometry in its own frame."""
    arrays = {
        source.get("id"): source.findtext("float_array", "") for source in shape.iter("source")
    }
    inputs = [part for part in shape.iterfind("mesh/vertices/input")
              if part.get("semantic") == "POSITION"]  # fmt: skip
    text = " ".join(arrays.get(part.get("source", "").removeprefix("#"), "") for part in inputs)
    return _row(text).reshape(-1, 3) if text.strip() else np.empty((0, 3))


def _row(text: str, multiple: int = 3) -> Float[ndarray, "N"]:
    """Return the numbers of a text, so many or a multiple of it."""
    try:
        numbers = np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        raise UntrustedFileError(f"a text has no numbers ({one_line(error, 80)})") from error
    if len(numbers) % multiple or not len(numbers):
        raise UntrustedFileError(f"it has {len(numbers)} numbers where {multiple} belong together")
    return numbers


def _matrix(text: str) -> ndarray:
    return _row(text, 16)[:16].reshape(4, 4)


def _moved(text: str) -> ndarray:
    move = np.eye(4)
    move[:3, 3] = _row(text)[:3]
    return move


def _scaled(text: str) -> ndarray:
    return np.diag([*_row(text)[:3], 1.0])


def _rotated(text: str) -> ndarray:
    turn = np.eye(4)
    *axis, degrees = _row(text, 4)[:4]
    turn[:3, :3] = Rotation.from_rotvec(np.radians(degrees) * np.array(axis)).as_matrix()
    return turn


NODE_MOVES: Final = {"matrix": _matrix, "translate": _moved, "scale": _scaled, "rotate": _rotated}


def _from_text(rows: list[tuple[bytes, bytes, bytes]]) -> Corners:
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, 3)
    except ValueError as error:
        raise UntrustedFileError(f"a corner is no number ({error})") from error
