"""Only regular files are opened, and none is waited for."""

import os
import socket
from pathlib import Path

import pytest

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import open_regular, read_regular


def test_a_regular_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"content")
    link = tmp_path / "link"
    link.symlink_to(path)
    assert read_regular(link, 7) == b"content"
    with pytest.raises(UntrustedFileError, match="it has 7 bytes; allowed: 6"):
        read_regular(path, 6)


def test_special_files_are_refused(tmp_path: Path) -> None:
    fifo, zero, listener = tmp_path / "fifo", tmp_path / "zero", tmp_path / "socket"
    os.mkfifo(fifo)
    zero.symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(listener))
        for path, kind in (
            (fifo, "a FIFO"), (zero, "a device"), (listener, "a socket"), (tmp_path, "a folder"),
        ):  # fmt: skip
            with pytest.raises(UntrustedFileError, match=f"it is {kind}; only regular files"):
                open_regular(path)


def test_what_is_not_there_is_an_error_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_regular(tmp_path / "none")
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(OSError, match="symbolic links"):
        read_regular(tmp_path / "loop")
