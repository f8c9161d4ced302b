"""JSON and YAML that nobody should read to the end."""

import json
import os
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from sain_core.errors import DatasetError, UntrustedFileError
from sain_core.guarding.untrusted import (
    DEPTH,
    DIGITS,
    YAML_BYTES,
    open_regular,
    parse_json,
    parse_yaml,
    read_json,
    read_yaml,
)

DEEP = "[" * (DEPTH + 1) + "]" * (DEPTH + 1)
READERS = [read_json, read_yaml]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (DEEP, "more than 64 deep"),
        ('{"a":' * 100_000, "more than 64 deep"),
        ("9" * (DIGITS + 1), "101 digits; allowed: 100"),
        ("[" + "1," * 4_000_000 + "1]", "more than 4,000,000 values"),
        ('["\\ud800"]', "half a character"),
        ("{", "Expecting property name"),
    ],
)
def test_json_is_refused(text: str, reason: str) -> None:
    with pytest.raises(UntrustedFileError, match=reason):
        parse_json(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (DEEP, "more than 64 deep"),
        ("\n".join(" " * n + "a:" for n in range(80)), "more than 64 deep"),
        ("9" * (DIGITS + 1), "101 digits"),
        ("0x" + "f" * 200, "202 digits"),
        ("1" + ":59" * 100, "digits"),
        ("a: &a [1]\nb: *a", "anchor"),
        ("a: &a 1", "anchor"),
        ("!!python/object:os.system x", "tag"),
        ("- a\n" * 200_000, "more than 200,000 values"),
        ("a" * (YAML_BYTES + 1), "bytes"),
        ("a: 2001-99-99", "a value cannot be read"),
        ("{a: b}: c", "unhashable"),
        ("[", "expected"),
    ],
)
def test_yaml_is_refused(text: str, reason: str) -> None:
    with pytest.raises(UntrustedFileError, match=reason):
        parse_yaml(text)


def test_what_is_within_the_limits_is_read() -> None:
    content = {"depth": json.loads("[" * 60 + "]" * 60), "digits": 10**90, "text": "x" * 5000}
    assert parse_json(json.dumps(content)) == content
    assert parse_yaml(json.dumps(content)) == content
    assert parse_yaml(f'a: ! "b"\nc: {"x" * 500}') == {"a": "b", "c": "x" * 500}


@pytest.mark.parametrize("read", READERS)
def test_a_file_that_is_no_text(read: Callable[[Path], Any], tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(DatasetError, match="not UTF-8"):
        read(path)


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
