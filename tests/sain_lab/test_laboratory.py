"""A laboratory's folder: whole at any moment, for one learner, and clear about what is wrong."""

import errno
import json
import os

import numpy as np
import pytest

from sain_core.errors import BusyError, DatasetError, OutputError
from sain_lab.keeping.laboratory import LOG, MANIFEST, Laboratory, OpenLaboratory, forget
from sain_lab.keeping.log import LogWriter, read_log


def test_a_log_that_is_cut_anywhere_keeps_every_whole_record(tmp_path):
    path = tmp_path / "log"
    writer = LogWriter(path)
    for number in range(3):
        writer.append({"kind": "push", "number": number, "text": "é" * number})
    writer.close()
    content = path.read_bytes()
    ends = [place for _, place in read_log(path)]
    for size in range(len(content) + 1):
        path.write_bytes(content[:size])
        again = LogWriter(path)
        again.append({"kind": "push", "number": 9})
        again.close()
        kept = [record["number"] for record, _ in read_log(path)]
        assert kept == [*range(sum(end <= size for end in ends)), 9], size


def test_a_bit_that_flips_before_the_last_record_is_an_error(tmp_path):
    path = tmp_path / "log"
    writer = LogWriter(path)
    for number in range(3):
        writer.append({"kind": "push", "number": number})
    writer.close()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(DatasetError, match=r"line \d does not have its checksum"):
        list(read_log(path))


def test_one_process_has_a_laboratory(tmp_path):
    with (
        OpenLaboratory(tmp_path / "mine", "first"),
        pytest.raises(BusyError, match=r"process \d+ \(first\) learns there"),
    ):
        OpenLaboratory(tmp_path / "mine")
    OpenLaboratory(tmp_path / "mine").close()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: change(path, format="sain-laboratory-9"), "this version reads"),
        (lambda path: change(path, log_bytes=10**6), "copy it again while nothing learns"),
        (lambda path: change(path, service="models/000100"), "model in service"),
        (lambda path: change(path, service="../../etc"), "is damaged"),
        (lambda path: change(path, generation=np.pi), "is damaged"),
        (lambda path: (path / LOG).unlink(), "not whole"),
        (lambda path: (path / MANIFEST).write_text("{"), "is damaged"),
    ],
)
def test_what_is_wrong_with_a_copy(tmp_path, damage, message):
    path = tmp_path / "copied"
    OpenLaboratory(path).close()
    Laboratory(path)
    damage(path)
    with pytest.raises(DatasetError, match=message):
        Laboratory(path)
    with pytest.raises(DatasetError, match=message):
        OpenLaboratory(path)


def change(path, **content):
    manifest = json.loads((path / MANIFEST).read_text())
    (path / MANIFEST).write_text(json.dumps(manifest | content))


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(OutputError, match="is no laboratory"):
        OpenLaboratory(tmp_path)
    with pytest.raises(DatasetError, match="no laboratory"):
        forget(str(tmp_path))
    assert (tmp_path / "thesis.tex").exists()


def test_forget_removes_it_unless_somebody_learns_there(tmp_path):
    path = tmp_path / "old"
    with OpenLaboratory(path), pytest.raises(BusyError, match="learns there"):
        forget(str(path))
    forget(str(path))
    assert not path.exists()


def test_a_full_disk_is_said_and_leaves_the_log_whole(tmp_path, monkeypatch):
    path = tmp_path / "log"
    writer = LogWriter(path)
    writer.append({"kind": "push", "number": 0})
    write = os.pwrite

    def half(file, content, place):
        if len(content) < 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, content[: len(content) // 2], place)

    with monkeypatch.context() as patch, pytest.raises(OutputError, match="No space left"):
        patch.setattr(os, "pwrite", half)
        writer.append({"kind": "push", "number": 1})
    writer.append({"kind": "push", "number": 2})
    writer.close()
    assert [record["number"] for record, _ in read_log(path)] == [0, 2]


def test_what_cannot_be_written_is_said(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OutputError, match="cannot write"):
        OpenLaboratory(blocked / "mine")
