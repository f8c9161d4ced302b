"""Arrays in npz files, and what makes one damaged.

A shard is a zip archive: every array in it has a CRC-32, which is checked as it is read, and
nothing in it is ever unpickled. What zlib and the zip format raise when bits have flipped is many
things; here all of them become one `DatasetError` that names the file.
"""

import hashlib
import os
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Mapping
from io import BytesIO
from math import prod
from pathlib import Path
from typing import IO, Final

import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.kinds import describe
from sain_core.guarding.untrusted import limit, open_regular, unpacked_bytes
from sain_core.output import write_file

ZIP_MAGIC: Final = b"PK\x03\x04"
ZIP_END: Final = b"PK\x05\x06"  # begins the last record, which may have a comment
ZIP_COUNT: Final = 10  # from there to the number of entries, two bytes
ZIP_TAIL: Final = 22 + 65535  # the most bytes from there to the end
NPY_HEADERS: Final = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
DAMAGE: Final = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    OverflowError,
    NotImplementedError,  # a compression method that does not exist
    RuntimeError,  # "encrypted"
    MemoryError,
    SyntaxError,  # numpy's own header
    tokenize.TokenError,  # likewise
    RecursionError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


def hash_files(files: Iterable[Path]) -> str:
    """Return the SHA-256 of files as if they were one, however large; raises `DatasetError`."""
    digest = hashlib.sha256()
    for path in files:
        try:
            with open_regular(path) as file:
                hashlib.file_digest(file, lambda: digest)
        except (OSError, UntrustedFileError) as error:
            raise DatasetError(f"{path} cannot be read: {error}") from error
    return digest.hexdigest()


def read_arrays(path: Path) -> dict[str, ndarray]:
    """Read every array of an npz file; raises `DatasetError`: it is none, truncated, or damaged."""
    try:
        with open_regular(path) as file:
            if file.read(len(ZIP_MAGIC)) != ZIP_MAGIC:  # numpy would take it for a pickle
                why = describe(path) or "does not begin as one"
                raise DatasetError(f"{path} is not a whole .npz file: it {why}")
            entries = _entries(file)
            file.seek(0)
            with np.load(file, allow_pickle=False) as archive:
                if len(archive.files) != entries:
                    raise DatasetError(f"{path} is not a whole .npz file: an array has got lost")
                _check_sizes(archive.zip, file)
                return {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise DatasetError(f"{path} does not exist") from None
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error
    except DAMAGE as error:
        raise DatasetError(f"{path} is not a whole .npz file: {error}") from error


def _check_sizes(archive: zipfile.ZipFile, file: IO[bytes]) -> None:
    """Check that arrays are not larger than they may be, nor than what is stored of them."""
    size = file.seek(0, os.SEEK_END)
    infos = archive.infolist()
    limit("bytes in its arrays", sum(info.file_size for info in infos), unpacked_bytes(size))
    for info in infos:
        with archive.open(info) as member:
            read_header = NPY_HEADERS[np.lib.format.read_magic(member)]
            shape, _, dtype = read_header(member)
            if not 0 <= prod(shape) * max(dtype.itemsize, 1) <= info.file_size:
                raise UntrustedFileError(f"an array of shape {shape} is larger than its file")


def _entries(file: IO[bytes]) -> int:
    """Return how many files the end of a zip archive says are in it.

    Python's `zipfile` does not look: where the length of an entry's comment is damaged, it takes
    the entries after it for the comment.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(max(size - ZIP_TAIL, 0))
    tail = file.read()
    place = tail.rfind(ZIP_END)
    return int(struct.unpack_from("<H", tail, place + ZIP_COUNT)[0]) if place >= 0 else -1


def write_arrays(path: Path, arrays: Mapping[str, ndarray], deflate_numbers: bool = True) -> None:
    """Write arrays as an npz file: whole, or not at all, as `write_file`.

    Not to deflate numbers but texts alone, which repeat themselves, is many times faster.
    """
    whole = BytesIO()  # a zip archive goes back and forth, which is slow in a file
    with zipfile.ZipFile(whole, "w", compresslevel=1) as archive:
        for name, array in arrays.items():
            deflate = deflate_numbers or array.dtype.kind == "U"
            archive.compression = zipfile.ZIP_DEFLATED if deflate else zipfile.ZIP_STORED
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asanyarray(array), allow_pickle=False)
    write_file(path, lambda file: file.write(whole.getbuffer()))
