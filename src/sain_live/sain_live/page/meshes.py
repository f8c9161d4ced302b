"""Meshes of a robot's links, read once: to read them again takes longer than the rest of a page.

What was read of a file is kept in the user's cache folder, until the file changes.
"""

import hashlib
import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple
from urllib.parse import unquote, urlsplit

import numpy as np

from sain_core.errors import ConfigError, SainError
from sain_core.storage import cache_folder, make_folder, read_arrays, write_arrays

LARGEST_MESH: Final = 50_000_000  # bytes of a file
MESHES: Final = (".obj", ".stl", ".ply", ".glb")
VERSION: Final = 1  # of what is kept
KEPT: Final = 200  # meshes; older ones are forgotten

Colour = tuple[int, int, int]


class Mesh(NamedTuple):
    """The part of a mesh that has one colour."""

    vertices: np.ndarray  # (V, 3) [m]
    faces: np.ndarray  # (F, 3), numbers of vertices
    colour: Colour


def read_mesh(filename: str, colour: Colour, own: bool) -> list[Mesh]:
    """Return the parts of a mesh, one for each colour that its file has.

    Args:
        filename: a path or a ``file:`` address.
        colour: of all, or with `own` of those parts that have none.
        own: whether the file's colours are taken.

    Raises:
        ConfigError: a file that is missing, too large or of a kind that is not read.
    """
    path = Path(unquote(urlsplit(filename).path))
    if urlsplit(filename).scheme not in ("", "file") or path.suffix.lower() not in MESHES:
        raise ConfigError(f"mesh {filename!r}; allowed: files of type {', '.join(MESHES)}")
    if not path.is_file() or path.stat().st_size > LARGEST_MESH:
        raise ConfigError(f"mesh {path} is missing or larger than {LARGEST_MESH >> 20} MB")
    kept = _place(path, colour, own)
    with suppress(SainError, KeyError, ValueError):  # it is not there, or damaged
        return _from_arrays(read_arrays(kept))
    meshes = list(_read(path, colour, own))
    with suppress(SainError, OSError):  # a full disk: it is read the next time, too
        make_folder(kept.parent)
        _forget_old(kept.parent)
        write_arrays(kept, _to_arrays(meshes), deflate_numbers=False)
    return meshes


def _place(path: Path, colour: Colour, own: bool) -> Path:
    """Return where a mesh is kept: another place for each state of its file."""
    state = path.stat()
    known = [VERSION, str(path.resolve()), state.st_size, state.st_mtime_ns, colour, own]
    name = hashlib.sha256(json.dumps(known).encode()).hexdigest()[:32]
    return cache_folder() / "meshes" / f"{name}.npz"


def _forget_old(folder: Path) -> None:
    kept = sorted(folder.glob("*.npz"), key=lambda one: one.stat().st_mtime_ns)
    for path in kept[: max(len(kept) - KEPT + 1, 0)]:
        path.unlink(missing_ok=True)


def _to_arrays(meshes: list[Mesh]) -> dict[str, np.ndarray]:
    arrays = {"colours": np.array([mesh.colour for mesh in meshes], np.uint8).reshape(-1, 3)}
    for number, mesh in enumerate(meshes):
        arrays[f"vertices{number}"] = mesh.vertices
        arrays[f"faces{number}"] = mesh.faces
    return arrays


def _from_arrays(arrays: dict[str, np.ndarray]) -> list[Mesh]:
    return [
        Mesh(arrays[f"vertices{number}"], arrays[f"faces{number}"], (red, green, blue))
        for number, (red, green, blue) in enumerate(arrays["colours"].tolist())
    ]


def _read(path: Path, colour: Colour, own: bool) -> Iterator[Mesh]:
    import trimesh  # for a second

    shades: dict[Colour, list[tuple[np.ndarray, np.ndarray]]] = {}
    loaded: Any = trimesh.load(path, force="scene")
    for node in loaded.graph.nodes_geometry:  # not dump(), which copies each texture for each part
        transform, name = loaded.graph[node]
        part = loaded.geometry[name]
        material = getattr(getattr(part, "visual", None), "material", None)
        main = getattr(material, "main_color", None)
        red, green, blue = colour if main is None or not own else map(int, main[:3])
        vertices = np.asarray(part.vertices) @ transform[:3, :3].T + transform[:3, 3]
        shades.setdefault((red, green, blue), []).append((vertices, np.asarray(part.faces)))
    for shade, parts in shades.items():
        before = np.cumsum([0, *(len(vertices) for vertices, _ in parts[:-1])])
        faces = [faces + first for (_, faces), first in zip(parts, before, strict=True)]
        vertices = np.concatenate([vertices for vertices, _ in parts])
        yield Mesh(vertices.astype(np.float32), np.concatenate(faces).astype(np.uint32), shade)
