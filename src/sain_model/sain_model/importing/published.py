"""Real pushes as Zhou et al. published them: an ``.npz`` of many of their logs, or the logs.

The npz has `COLUMNS` in m, rad and m/s. A log is a MATLAB file of one surface, body and speed, with
``surface_type``, ``shape_id``, ``vel`` [mm/s] and ``record_all``, a struct for each push. SciPy
reads logs, and crashes on some damaged ones. So a process of its own reads them, which may only use
so much memory.
"""

import resource
import zlib
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from io import BytesIO
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import MIB, limit, read_regular, unpacked_bytes
from sain_core.storage import DAMAGE, read_arrays
from sain_model.importing.real_pushes import LONGEST_TEXT, MOST_PUSHES, RealPushes

COLUMNS: Final = {  # numbers of a row; none: text
    "surface": None,
    "shape": None,
    "speed": 0,
    "init_pose": 3,
    "final_pose": 3,
    "tip_init": 2,
    "tip_final": 2,
}
RECORD: Final = {  # fields of a log's structs
    "init_pose": "init_pose_gt",
    "final_pose": "final_pose_gt",
    "tip_init": "init_tip_pt",
    "tip_final": "final_tip_pt",
}
TIP_RADIUS: Final = 0.00475  # [m], of that laboratory's tool, which no file states

MOST_BYTES: Final = 64 * MIB  # of a log
MEMORY: Final = 4096 * MIB  # of the process
PATIENCE: Final = 600.0  # [s], for a log
COMPRESSED: Final = 15  # type of an element of a MATLAB file
MAT_HEADER: Final = 128  # bytes
PIECE: Final = 1 << 16


def is_published(path: Path) -> bool:
    """Return whether an npz is of this form; raises `DatasetError` where it is damaged."""
    return set(COLUMNS) <= set(read_arrays(path))


def read_npz(path: Path, tip_radius: float = TIP_RADIUS) -> RealPushes:
    """Return the pushes of an npz; raises `DatasetError`: it is damaged, or of another form."""
    return _pushes(path, read_arrays(path), tip_radius)


def read_logs(paths: Sequence[Path], tip_radius: float = TIP_RADIUS) -> list[RealPushes]:
    """Return the pushes of each log.

    Raises `DatasetError`: one is damaged, too large, or of another form.
    """
    found = []
    with ProcessPoolExecutor(1, get_context("spawn"), _limit_process) as process:
        for path in paths:
            try:
                arrays = process.submit(_read_log, path).result(PATIENCE)
            except BrokenProcessPool:
                raise DatasetError(
                    f"{path} is not a whole MATLAB file: SciPy crashes on it"
                ) from None
            except TimeoutError as error:
                raise DatasetError(f"{path} was not read in {PATIENCE:g} s") from error
            found.append(_pushes(path, arrays, tip_radius))
    return found


def _pushes(path: Path, arrays: dict[str, ndarray], tip_radius: float) -> RealPushes:
    """Return pushes of these columns; raises `DatasetError`: they are of another form."""
    if missing := [name for name in COLUMNS if name not in arrays]:
        raise DatasetError(f"{path} is of another form: it lacks {', '.join(missing)}")
    count = len(arrays["speed"]) if arrays["speed"].ndim else 0
    if not 0 < count <= MOST_PUSHES:
        raise DatasetError(f"{path} has {count} pushes; allowed: 1 to {MOST_PUSHES:,}")
    for name, size in COLUMNS.items():
        shape = (count, size) if size else (count,)
        kinds, wanted = ("U", "text") if size is None else ("fiu", "real numbers")
        found = arrays[name]
        if found.shape != shape or found.dtype.kind not in kinds:
            raise DatasetError(
                f"{path}: {name} is {found.dtype} of shape {found.shape}; it should be {wanted} of"
                f" shape {shape}"
            )
    surface, body, *numbers = (arrays[name] for name in COLUMNS)
    speed, before, after, start, end = (array.astype(np.float64) for array in numbers)
    names = zip(surface.tolist(), body.tolist(), speed.tolist(), strict=True)
    run = np.array([f"{ground}_{name}_v{1e3 * fast:g}" for ground, name, fast in names])
    radius, unknown = np.full(count, tip_radius), np.full(count, np.nan)
    places = np.zeros(count, np.int64), np.arange(count) + 1
    columns = surface, body, run, before, after, start, end, speed, radius, unknown, unknown
    return RealPushes(*columns, *places, (str(path),))


# --- in the process -------------------------------------------------------------------------------


def _limit_process() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _read_log(path: Path) -> dict[str, ndarray]:
    """Return the columns of a log."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        raw = read_regular(path, MOST_BYTES)
        _check_unpacked(raw)
        content: dict[str, Any] = loadmat(BytesIO(raw), simplify_cells=True)
        records = np.atleast_1d(np.asarray(content["record_all"], dtype=object)).ravel()
        columns = {
            name: np.array([record[key] for record in records], np.float64)
            for name, key in RECORD.items()
        }
        for name, key in (("surface", "surface_type"), ("shape", "shape_id")):
            columns[name] = np.full(len(records), str(content[key])[:LONGEST_TEXT])
        return columns | {"speed": np.full(len(records), 1e-3 * float(content["vel"]))}
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    except (*DAMAGE, MatReadError, TypeError, IndexError, AttributeError) as error:
        raise DatasetError(f"{path} is not a whole MATLAB file: {error}") from error


def _check_unpacked(raw: bytes) -> None:
    """Check that what is compressed does not unpack to more than it may."""
    place, unpacked, most = MAT_HEADER, 0, unpacked_bytes(len(raw))
    while place + 8 <= len(raw):
        kind, size = np.frombuffer(raw, "<u4", 2, place).tolist()
        if kind == COMPRESSED:
            stream, rest = zlib.decompressobj(), raw[place + 8 : place + 8 + size]
            while rest and not stream.eof:
                unpacked += len(stream.decompress(rest, PIECE))
                limit("bytes in its arrays", unpacked, most)
                rest = stream.unconsumed_tail
        place += 8 + size
