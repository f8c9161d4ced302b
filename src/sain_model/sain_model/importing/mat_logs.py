"""Logs of real pushes as Zhou et al. published them: MATLAB files of one surface, body and speed.

A log has ``surface_type``, ``shape_id``, ``vel`` [mm/s] and ``record_all``, a struct for each push
with ``init_pose_gt``, ``final_pose_gt``, ``init_tip_pt`` and ``final_tip_pt``.

SciPy reads them, and crashes on some damaged ones. So a process of their own reads them, which
may only use so much memory: ``python -m sain_model.importing.mat_logs FOLDER LOG...``.
"""

import resource
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import MIB, limit, read_regular, unpacked_bytes
from sain_core.storage import DAMAGE, read_arrays, write_arrays
from sain_model.importing.real_pushes import LONGEST_TEXT, MOST_PUSHES, RealPushes, published_pushes

RECORDS: Final = "record_all"
FIELDS: Final = {"init_pose_gt": 3, "final_pose_gt": 3, "init_tip_pt": 2, "final_tip_pt": 2}
HEADER: Final = ("surface_type", "shape_id", "vel")
MOST_BYTES: Final = 64 * MIB  # of a log
MEMORY: Final = 4096 * MIB  # of the process
PATIENCE: Final = 600.0  # [s], for all logs
COMPRESSED: Final = 15  # type of an element of a MATLAB file
MAT_HEADER: Final = 128  # bytes
PIECE: Final = 1 << 16


def read_mats(paths: Sequence[Path]) -> list[RealPushes]:
    """Return the pushes of each log.

    Raises `DatasetError`: one is damaged, too large, or of another form.
    """
    if not paths:
        return []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        try:
            subprocess.run(
                [sys.executable, "-m", __name__, name, *(str(path.resolve()) for path in paths)],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=PATIENCE,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise DatasetError(f"the logs were not read in {PATIENCE:g} s") from error
        return [_result(folder, index, path) for index, path in enumerate(paths)]


def _result(folder: Path, index: int, path: Path) -> RealPushes:
    """Return what the process read from a log, or raise what it found wrong."""
    wrong, read = folder / f"{index}.txt", folder / f"{index}.npz"
    if wrong.exists():
        raise DatasetError(f"{path} {wrong.read_text()}")
    if not read.exists():
        raise DatasetError(f"{path} is not a whole MATLAB file: SciPy crashes on it")
    arrays = read_arrays(read)
    columns = (arrays[name] for name in FIELDS)
    surface, body, speed = (arrays[name] for name in HEADER)
    return published_pushes(path, surface, body, speed, *columns)


# --- in the process -------------------------------------------------------------------------------


def main(arguments: Sequence[str]) -> int:
    """Read logs, each into a file of arrays, or of what is wrong with it."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    folder, *paths = map(Path, arguments)
    for index, path in enumerate(paths):
        try:
            write_arrays(folder / f"{index}.npz", _columns(_load(path)))
        except DatasetError as error:
            (folder / f"{index}.txt").write_text(str(error))
            break
    return 0


def _load(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        raw = read_regular(path, MOST_BYTES)
        _check_unpacked(raw)
        content: dict[str, Any] = loadmat(BytesIO(raw), simplify_cells=True)
    except UntrustedFileError as error:
        raise DatasetError(f"is not read: {error}") from error
    except (*DAMAGE, MatReadError, TypeError, IndexError, AttributeError) as error:
        raise DatasetError(f"is not a whole MATLAB file: {error}") from error
    return content


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


def _columns(content: dict[str, Any]) -> dict[str, ndarray]:
    """Return the columns of a log."""
    if missing := [name for name in (RECORDS, *HEADER) if name not in content]:
        raise DatasetError(f"is of another form: it lacks {', '.join(missing)}")
    records = np.atleast_1d(np.asarray(content[RECORDS], dtype=object)).ravel()
    count = len(records)
    if not 0 < count <= MOST_PUSHES:
        raise DatasetError(f"has {count} pushes; allowed: 1 to {MOST_PUSHES:,}")
    surface, body, speed = (content[name] for name in HEADER)
    texts = isinstance(surface, str) and isinstance(body, str)
    if not texts or np.ndim(speed) or np.asarray(speed).dtype.kind not in "fiu":
        raise DatasetError(f"is of another form: {', '.join(HEADER)} are two texts and a number")
    columns = {name: _column(records, name, size) for name, size in FIELDS.items()}
    names = dict(zip(HEADER, (surface[:LONGEST_TEXT], body[:LONGEST_TEXT]), strict=False))
    texts_of = {name: np.full(count, text) for name, text in names.items()}
    return {**columns, **texts_of, "vel": np.full(count, 1e-3 * float(speed))}


def _column(records: ndarray, name: str, size: int) -> ndarray:
    """Return a field (M, size) of all structs."""
    rows = np.empty((len(records), size))
    for index, record in enumerate(records):
        value = np.asarray(record.get(name) if isinstance(record, dict) else None)
        if value.shape != (size,) or value.dtype.kind not in "fiu":
            raise DatasetError(
                f"is of another form: {name} of push {index + 1} is {value.dtype} of shape"
                f" {value.shape}; it should be {size} numbers"
            )
        rows[index] = value
    return rows


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
