"""A body from a mesh (STL, OBJ, PLY): its outline from above, its height, its centre of mass.

Projected triangles that are all turned the same way cover a point as often as their edges wind
about it. An edge that two of them share in opposite directions cancels. So the edges that are left
bound the projection, and these are few: a million triangles take seconds. Holes are filled.
"""

from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from jaxtyping import Float, Int
from numpy import ndarray

from sain_core.errors import ConfigError, DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import LEAST_RADIUS, one_line, read_regular, reason_of
from sain_core.scene import DISK_HEIGHT
from sain_core.shapes.outlines import (
    FAIR_SHARES,
    MOST_HEIGHT,
    BodyOutline,
    fair_model,
    few_corners,
    trace,
)
from sain_core.types import Points

Vertices = Float[ndarray, "V 3"]  # [m]
Faces = Int[ndarray, "F 3"]

FORMATS: Final = (".stl", ".obj", ".ply")
UNITS: Final = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
AXES: Final = {"z": (0, 1, 2), "y": (2, 0, 1), "x": (1, 2, 0)}  # that become x, y, z
UPWARD: Final = (*AXES, *(f"-{axis}" for axis in AXES))
LARGEST: Final = 1.0  # [m], above which a mesh is in another unit
MOST_FACES: Final = 5_000_000
GRIDS: Final = (1e-5, 1e-4, 5e-4)  # [m], to which places are rounded
MOST_EDGES: Final = 20_000  # of the projection, above which they are rounded more
SPECK: Final = 0.01  # of the area of the largest part, below which another part is noise
SMALLEST_HOLE: Final = 1e-5  # [m^2]
SLICES: Final = (0.25, 0.5, 0.75)  # of the height
CLOSING: Final = 0.0015  # [m], half of a gap in a slice of a scan that is closed
PLACES: Final = 1 << 19  # along the longest side, to which vertices are rounded to be joined
TINY: Final = 1e-6  # of the box about a mesh, below which it encloses no volume
BASE: Final = 0.05  # of the height: what is lower carries the body


class Mesh(NamedTuple):
    """The triangles of a body, as it lies on the table."""

    vertices: Vertices
    faces: Faces
    mass_centre: Float[ndarray, "3"] | None  # [m], of uniform density; None: it is not closed
    volume: float  # [m^3]; 0: it is not closed


@dataclass(frozen=True)
class MeshBody:
    """What a mesh says of a body."""

    body: BodyOutline
    tolerance: float  # within which corners were left out [m]
    slices: tuple[float, ...]  # areas at `SLICES`, as shares of the outline's
    steady: float  # friction above which it tips before it slides, pushed as our bodies are


def read_mesh(
    path: Path, name: str, unit: str = "m", up: str = "z", density: float | None = None
) -> MeshBody:
    """Return the body of a mesh that lies as it is to be pushed.

    Args:
        path: of an STL, OBJ or PLY file.
        name: of the body.
        unit: of the file, one of `UNITS`.
        up: its axis that points upwards, one of `UPWARD`; ``-z``: it lies upside down.
        density: [kg/m^3] of a closed mesh, for its mass.

    Raises:
        ConfigError: trimesh is not installed.
        DatasetError: the file is no mesh, has the size of another unit, or parts that lie apart.
    """
    mesh = _placed(path, _loaded(path), unit, up)
    outline, mended = _outline(path, mesh)
    area = _area(outline)
    corners, tolerance = few_corners(outline, f"{path}: the outline")
    low, high = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
    slices = tuple(_slice_area(mesh, low + at * (high - low)) / area for at in SLICES)
    body = trace(name, corners, str(path))
    middle, offset = np.array(body.centre), None
    if mesh.mass_centre is None:
        mended.append("the mesh is not closed: its mass and its centre of mass are unknown")
    else:
        middle = mesh.mass_centre[:2]
        offset = (float(middle[0] - body.centre[0]), float(middle[1] - body.centre[1]))
    body = replace(
        body,
        height=float(high - low),
        mass=density * mesh.volume if density and mesh.volume else None,
        mass_centre=offset,
        fair=""
        if mesh.mass_centre is None and min(slices) < FAIR_SHARES[1]
        else fair_model(slices),
        mended=(*body.mended, *mended),
    )
    return MeshBody(body, tolerance, slices, _steady(mesh.vertices, middle))


def _loaded(path: Path) -> Any:
    """Return the mesh of a file as trimesh has it."""
    if path.suffix.lower() not in FORMATS:
        raise DatasetError(f"{path} is no mesh that is read; allowed: {', '.join(FORMATS)}")
    try:
        import trimesh
    except ImportError as error:
        raise ConfigError(
            "a mesh needs trimesh, which is not installed; install it with pip install trimesh, or"
            " run inside ./env"
        ) from error
    try:
        content = read_regular(path)
    except (OSError, UntrustedFileError) as error:
        raise DatasetError(f"{path} cannot be read: {reason_of(error)}") from error
    try:
        mesh: Any = trimesh.load(
            BytesIO(content),
            file_type=path.suffix.lower()[1:],
            force="mesh",
            process=False,
            skip_materials=True,
        )
        count = len(getattr(mesh, "faces", ()))
    except Exception as error:  # whatever a parser of others makes of a damaged file
        raise DatasetError(
            f"{path} is damaged, or no {path.suffix[1:].upper()} file: {one_line(error, 200)}"
        ) from error
    if not 0 < count <= MOST_FACES:
        raise DatasetError(f"{path} has {count:,} triangles; allowed: 1 to {MOST_FACES:,}")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise DatasetError(f"{path} is damaged: a triangle has a corner that is not in the file")
    if not np.isfinite(mesh.vertices).all():
        raise DatasetError(f"{path} has vertices that are NaN or Inf; export the mesh anew")
    return mesh


def _placed(path: Path, mesh: Any, unit: str, up: str) -> Mesh:
    """Return the triangles [m] with z upwards; raises `DatasetError` for a size of another unit."""
    axes, sign = list(AXES[up[-1]]), -1.0 if up.startswith("-") else 1.0
    turn = UNITS[unit] * np.array([1.0, sign, sign])  # half a turn about x
    vertices = np.asarray(mesh.vertices, dtype=np.float64)[:, axes] * turn
    extent = np.ptp(vertices, axis=0)
    size = float(extent.max())
    if size > LARGEST or size < 2 * LEAST_RADIUS:
        bare = size / UNITS[unit]
        others = [one for one, factor in UNITS.items() if 0.02 <= bare * factor <= LARGEST]
        hint = f"; if the file is in {' or '.join(others)}, --unit {others[-1]}" if others else ""
        raise DatasetError(
            f"{path} is {size:.4g} m large; allowed: {2 * LEAST_RADIUS} to {LARGEST:g} m{hint}"
        )
    if not LEAST_RADIUS <= extent[2] <= MOST_HEIGHT:
        raise DatasetError(
            f"{path} is {1e3 * extent[2]:.4g} mm high; allowed: {1e3 * LEAST_RADIUS:g} to"
            f" {1e3 * MOST_HEIGHT:g} mm; --up names the axis that points upwards"
        )
    faces = _joined(vertices)[np.asarray(mesh.faces)]
    if _edges(faces)[1].any():
        return Mesh(vertices, faces, None, 0.0)
    one, two, three = (vertices[faces] - vertices[0]).swapaxes(0, 1)
    parts = np.einsum("ij,ij->i", one, np.cross(two, three))  # six times a tetrahedron each
    volume = float(parts.sum()) / 6
    if abs(volume) < TINY * float(extent.prod()):
        return Mesh(vertices, faces, None, 0.0)
    centre = vertices[0] + parts @ (one + two + three) / (24 * volume)
    return Mesh(vertices, faces, centre, abs(volume))


def _joined(vertices: Vertices) -> Int[ndarray, "V"]:
    """Return for each vertex the first one at its place: an STL file has one for each corner."""
    low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    cells = np.round((vertices - low) * (PLACES / size)).astype(np.int64)
    _, first, index = np.unique(
        cells @ [4 * PLACES**2, 2 * PLACES, 1], return_index=True, return_inverse=True
    )
    return np.asarray(first[index])


def _edges(faces: Faces) -> tuple[Int[ndarray, "E 2"], Float[ndarray, "E"]]:
    """Return the edges of triangles (E, 2), and how often they are one way less the other, (E,)."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    count = int(faces.max()) + 1
    keys, edge = np.unique(
        np.minimum(start, end) * count + np.maximum(start, end), return_inverse=True
    )
    turns = np.bincount(edge, np.sign(end - start), len(keys))
    return np.stack(np.divmod(keys, count), axis=1), turns


def _outline(path: Path, mesh: Mesh) -> tuple[Points, list[str]]:
    """Return the outline (M, 2) [m] of the projection, and what was done to it in words."""
    from shapely import coverage_union_all, get_parts, linestrings, polygonize, union_all

    for grid in GRIDS:  # noise on steep sides leaves many edges
        starts, ends, turns = _rim(mesh, grid)
        if len(turns) <= MOST_EDGES:
            break
    noded = union_all(linestrings(np.stack([starts, ends], axis=1)), grid_size=grid)
    cells = get_parts(polygonize([noded]))
    if not len(cells):
        raise DatasetError(f"{path} covers nothing, seen from above; --up names the axis upwards")
    parts = sorted(get_parts(coverage_union_all(cells)), key=lambda part: -part.area)
    kept = [part for part in parts if part.area > SPECK * parts[0].area]
    if len(kept) > 1:
        areas = ", ".join(f"{1e4 * part.area:.1f}" for part in kept)
        raise DatasetError(
            f"{path} has {len(kept)} parts that lie apart, seen from above, of {areas} cm^2; a body"
            " is one: export a part alone"
        )
    mended = []
    if len(parts) > 1:
        mended.append(f"{len(parts) - 1} specks beside the body are left out")
    holes = [
        1e4 * cell.area
        for cell in cells
        if cell.area > SMALLEST_HOLE and not _covered(cell, starts, ends, turns)
    ]
    if holes:
        mended.append(f"holes of {', '.join(f'{hole:.1f}' for hole in holes)} cm^2 are filled")
    return np.array(parts[0].exterior.coords)[:-1], mended


def _rim(mesh: Mesh, grid: float) -> tuple[Points, Points, Float[ndarray, "E"]]:
    """Return the projected edges that do not cancel, by places on a grid [m].

    They go from (E, 2) to (E, 2) [m], so many times (E,).
    """
    rounded = np.round(mesh.vertices[:, :2] / grid).astype(np.int64)
    base = rounded.min(axis=0)
    rounded -= base
    wide = int(rounded[:, 1].max()) + 1
    keys, index = np.unique(rounded @ [wide, 1], return_inverse=True)
    places = np.stack(np.divmod(keys, wide), axis=1)
    triangles = index[mesh.faces]
    one, two, three = places[triangles].swapaxes(0, 1)
    (ax, ay), (bx, by) = (two - one).T, (three - one).T
    area = ax * by - ay * bx
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    triangles = triangles[area != 0]
    if not len(triangles):
        return np.empty((0, 2)), np.empty((0, 2)), np.empty(0)
    edges, turns = _edges(triangles)
    starts, ends = ((places + base) * grid)[edges[turns != 0.0]].swapaxes(0, 1)
    return starts, ends, turns[turns != 0.0]


def _covered(cell: Any, starts: Points, ends: Points, turns: Float[ndarray, "E"]) -> bool:
    """Return whether edges wind about the inside of a cell."""
    x, y = cell.representative_point().coords[0]
    (ax, ay), (bx, by) = starts.T, ends.T
    up, down = (ay <= y) & (by > y), (by <= y) & (ay > y)
    crossing = up | down
    at = ax[crossing] + (y - ay[crossing]) * (bx - ax)[crossing] / (by - ay)[crossing]
    way = np.where(up[crossing], 1.0, -1.0) * turns[crossing]
    return bool(abs(way[at > x].sum()) > 0.5)


def _slice_area(mesh: Mesh, height: float) -> float:
    """Return the area [m^2] of a slice, its holes and the gaps of a scan filled."""
    from shapely import Polygon, get_parts, line_merge, linestrings, union_all

    above = mesh.vertices[:, 2] > height
    count = above[mesh.faces].sum(axis=1)
    cut = mesh.faces[(count == 1) | (count == 2)]
    if not len(cut):
        return 0.0
    odd = np.where(above[cut].sum(axis=1, keepdims=True) == 1, above[cut], ~above[cut])
    first = np.argmax(odd, axis=1)[:, None]
    tip = mesh.vertices[np.take_along_axis(cut, first, axis=1)[:, 0]]
    ends = []
    for step in (1, 2):
        other = mesh.vertices[np.take_along_axis(cut, (first + step) % 3, axis=1)[:, 0]]
        share = (height - tip[:, 2]) / (other[:, 2] - tip[:, 2])
        ends.append(tip[:, :2] + share[:, None] * (other - tip)[:, :2])
    lines = line_merge(union_all(linestrings(np.stack(ends, axis=1)), grid_size=GRIDS[0]))
    lines = lines.simplify(CLOSING / 10).buffer(CLOSING)
    filled = union_all([Polygon(part.exterior) for part in get_parts(lines)])
    return float(filled.buffer(-CLOSING).area)


def _steady(vertices: Vertices, middle: Float[ndarray, "2"]) -> float:
    """Return the friction above which a push at the height of our tool tips a body over.

    Friction acts at the table. The body tips about the edge of its base where that is nearer to the
    centre of mass than friction times the height of the push.
    """
    from shapely import MultiPoint, Point

    heights = vertices[:, 2] - vertices[:, 2].min()
    base = MultiPoint(vertices[heights <= BASE * heights.max()][:, :2]).convex_hull
    inside = base.contains(Point(middle))
    return float(base.boundary.distance(Point(middle)) / (DISK_HEIGHT / 2)) if inside else 0.0


def _area(outline: Points) -> float:
    from shapely import Polygon

    return float(Polygon(outline).area)
