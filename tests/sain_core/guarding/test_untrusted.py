# ruff: noqa: E501 - a case is a line
"""Only regular files are read."""

import os
import re
import socket

import pytest

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import open_regular, read_regular


def test_special_files_are_refused(tmp_path):
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


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "`git lfs pull` fetches it"),
        (b"\x28\xb5\x2f\xfd rest", "`zstd -d FILE`"),
        (b"\x1f\x8b\x08 rest", "`gunzip FILE`"),
        (b"\xef\xbb\xbf\n <!DOCTYPE html><html>Not found</html>", "it is a web page"),
    ],
)  # fmt: skip
def test_what_stands_in_for_a_file_is_named(content, text, tmp_path):
    path = tmp_path / "bodies.yaml"
    path.write_bytes(content)
    with pytest.raises(UntrustedFileError, match=re.escape(text)):
        read_regular(path)
    path.write_bytes(b"# <html> in a comment\n" + content[:4])
    assert read_regular(path).endswith(content[:4])
