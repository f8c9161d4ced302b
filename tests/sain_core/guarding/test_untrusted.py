"""Only regular files are read."""

import os
import socket
from pathlib import Path

import pytest

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import open_regular


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
