"""A laboratory's folder: whole at any moment, for one learner, and clear about what is wrong."""

import errno
import json
import os
import re
from contextlib import suppress
from dataclasses import replace
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from sain_core.errors import BusyError, DatasetError, OutputError, SainError
from sain_core.shapes import library
from sain_core.shapes.bodies import Bodies
from sain_core.shapes.outlines import OUTLINES_FILE, trace
from sain_lab.cli.lab import LabOptions, run
from sain_lab.learner import Learner
from sain_lab.storage.laboratory import LOG, MANIFEST, WAITING, Laboratory, OpenLaboratory, forget
from sain_lab.storage.log import MOST_BYTES, LogReader, LogWriter
from tests.sain_lab.table import SmallTable

PUSH = {"kind": "push", **SmallTable().push().record()}
EVENT = {"event": "loaded", "text": "", "pushes": 0, "time": 0.0}


def sain_lab(action, *names, **options):
    """Return what the command prints."""
    printed = StringIO()
    run(LabOptions(action, names, **options), Console(file=printed, width=200))
    return printed.getvalue()


@pytest.fixture
def log(tmp_path):
    """The path of a log with three records."""
    path = tmp_path / "log"
    writer = LogWriter(path)
    for number in range(3):
        writer.append({"kind": "push", "number": number, "digest": "", "text": "é" * number})
    writer.close()
    return path


def numbers(path):
    return [record["number"] for record in LogReader(path).read()]


def test_a_log_that_is_cut_anywhere_keeps_every_whole_record(log):
    content, reader = log.read_bytes(), LogReader(log)
    ends = [reader.place for _ in reader.read()]
    for size in sorted({*range(0, len(content) + 1, 3), *ends}):
        log.write_bytes(content[:size])
        again = LogWriter(log)
        again.append({"kind": "push", "number": 9})
        again.close()
        assert numbers(log) == [*range(sum(end <= size for end in ends)), 9], size


def test_a_bit_that_flips_anywhere_is_named_and_the_file_is_not_rewritten(log):
    """Flip a bit of every third byte: at most two lines are lost, said, and nothing is cut off."""
    content = log.read_bytes()
    first = content.index(b"\n") + 1
    for place in range(0, len(content), 3):
        damaged = bytearray(content)
        damaged[place] ^= 1
        log.write_bytes(damaged)
        writer = LogWriter(log)
        writer.append({"kind": "push", "number": 9})
        writer.close()
        assert log.read_bytes()[: len(content)] == damaged, place
        reader = LogReader(log)
        kept = [record["number"] for record in reader.read()]
        assert kept[-1] == 9 and len(kept) >= 2, place
        assert any(f"of {log} is damaged (CRC); " in text for text in reader.damage), place
        missing = sum(int(n) for text in reader.damage for n in re.findall(r"(\d) push", text))
        assert missing == (4 - len(kept) if place >= first else missing), reader.damage


def test_a_file_of_something_else_is_not_made_a_log(tmp_path):
    path = tmp_path / "log"
    path.write_text("my diary")
    with pytest.raises(DatasetError, match="is no log of a laboratory from byte 0 on; move it"):
        LogWriter(path)
    assert path.read_text() == "my diary"


@pytest.mark.parametrize(
    ("record", "reason"),
    [
        ({"kind": "push"}, "it has no 'before'); 1 push is missing"),
        (PUSH, "it has no 'errors'); 1 push is missing"),
        ({"kind": "event", **EVENT, "event": "not learned", "about": {"id": []}}, "id is []"),
        ({"kind": "event", **EVENT, "event": "training", "about": []}, "about is []"),
        ({"kind": "event", "event": "loaded"}, "it has no 'text'); no push is missing"),
        ({"kind": "event", **EVENT, "about": {"service": "../x"}}, "service is '../x'"),
        ({"kind": "event", **EVENT, "about": {"service": "planar"}, "pushes": -1}, "pushes is -1"),
        ({"kind": "belief", "pushes": 1, "parameters": {"luck": [1, 2]}}, "it has no 'luck'"),
        ({"kind": "belief", "pushes": 1, "parameters": []}, "is damaged"),
        ({"kind": "dream"}, "its kind 'dream' is not of this version"),
    ],
)
def test_a_record_without_what_its_kind_needs_is_named_and_left_out(tmp_path, record, reason):
    path, table = tmp_path / "lab", SmallTable()
    with OpenLaboratory(path) as laboratory:
        push = {"kind": "push", "errors": {}}
        for line in (push | table.push().record(), record, push | table.push().record()):
            laboratory.append(line)
    text = sain_lab("show", str(path))
    assert "2 pushes" in text
    assert f"line 3 of {path / LOG} is damaged" in text and reason in text


def test_what_waits_is_counted_without_what_was_learned(tmp_path):
    """A damaged line keeps the file of what was received."""
    path, table = tmp_path / "lab", SmallTable()
    first, second = (table.push().identified() for _ in range(2))
    with OpenLaboratory(path) as laboratory:
        laboratory.append({"kind": "push", "errors": {}, **first.record()})
        for record in ({"kind": "push"}, PUSH | first.record(), PUSH | second.record()):
            laboratory.receive(record)
    text = sain_lab("show", str(path))
    assert "1 pushes were received and wait" in text
    assert f"line 2 of {path / WAITING} is damaged (it has no 'before')" in text


def test_bodies_of_a_data_set_are_found_by_another_process(tmp_path, monkeypatch):
    plank = trace("plank", np.array([[0, 0], [0.1, 0], [0.1, 0.031], [0, 0.03]])).shape
    library.register(plank)
    push = replace(SmallTable().push(), bodies=Bodies((plank, plank)))
    with Learner.named(str(tmp_path / "lab"), trains=False) as learner:
        learner.receive(SmallTable().push())
        assert not (tmp_path / "lab" / OUTLINES_FILE).exists(), "the library has disks"
        learner.receive(push)
    monkeypatch.delitem(library._shapes, plank.name)  # as in a process that did not read them
    found = Laboratory(tmp_path / "lab")
    assert [one.bodies for one in found.waiting()][-1] == push.bodies
    assert not found.damage
    assert forget(str(tmp_path / "lab")) and not (tmp_path / "lab").exists()


def test_a_belief_that_was_changed_is_not_replaced(tmp_path):
    path = tmp_path / "lab"
    OpenLaboratory(path).close()
    (path / "belief.json").write_text("mine")
    with pytest.raises(OutputError, match=r"belief\.json was changed since .*; move it away$"):
        OpenLaboratory(path)
    assert (path / "belief.json").read_text() == "mine"


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda path: change(path, format="sain-laboratory-9"), "this version reads"),
        (lambda path: change(path, log_bytes=10**6), "copy it again while nothing learns"),
        (lambda path: change(path, service="models/000100"), "model in service"),
        (lambda path: change(path, service="../../etc"), "is damaged"),
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


def test_a_log_that_is_too_large_is_not_read(tmp_path):
    (tmp_path / LOG).touch()
    os.truncate(tmp_path / LOG, MOST_BYTES + 1)  # a hole: it needs no room
    with pytest.raises(DatasetError, match="4,294,967,297 bytes; allowed: 4,294,967,296"):
        list(LogReader(tmp_path / LOG).read())


def change(path, **content):
    manifest = json.loads((path / MANIFEST).read_text())
    (path / MANIFEST).write_text(json.dumps(manifest | content))


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(OutputError, match=r"has thesis\.tex, and SAIN did not make this folder"):
        OpenLaboratory(tmp_path)
    with pytest.raises(DatasetError, match="no laboratory"):
        sain_lab("forget", str(tmp_path))
    assert (tmp_path / "thesis.tex").exists()


def files(path):
    return sorted(str(one.relative_to(path)) for one in path.rglob("*"))


def of_a_stranger(path):
    """Make a laboratory with a folder of the user's own among the networks."""
    OpenLaboratory(path).close()
    (path / "models" / "mine").mkdir(parents=True)
    (path / "models" / "mine" / "weights").touch()
    return path


def linked_models(path):
    """Make a laboratory whose networks are behind a link."""
    OpenLaboratory(path).close()
    (path.parent / "elsewhere" / "000050").mkdir(parents=True)
    (path.parent / "elsewhere" / "000050" / "weights").touch()
    (path / "models").symlink_to(path.parent / "elsewhere")
    return path


def with_a_manifest_alone(path):
    """Make a folder that has a file with the name of a laboratory's manifest."""
    path.mkdir()
    (path / MANIFEST).write_text("{}")
    return path


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (of_a_stranger, "nothing is removed"),
        (linked_models, "is a symbolic link"),
        (with_a_manifest_alone, "is damaged: it has no 'format'"),
    ],
)
def test_what_is_not_ours_is_neither_forgotten_nor_removed_by_a_learner(tmp_path, make, reason):
    path = make(tmp_path / "lab")
    before = files(tmp_path)
    with pytest.raises(SainError, match=reason):
        sain_lab("forget", str(path))
    assert files(tmp_path) == before
    with suppress(SainError):
        Learner.named(str(path)).close()
    assert set(files(tmp_path)) >= set(before)


def test_one_process_has_a_laboratory_and_forget_removes_it_later(tmp_path):
    path = tmp_path / "old"
    with OpenLaboratory(path):
        for attempt in (OpenLaboratory, lambda path: forget(str(path))):
            with pytest.raises(BusyError, match=r"process \d+ \(learner\) learns there"):
                attempt(path)
    assert f"removed {path}" in sain_lab("forget", str(path))
    assert not path.exists()


@pytest.mark.parametrize("name", ["belief.json", "chart.png"])
def test_files_of_others_are_not_written_over(tmp_path, name):
    path, out = tmp_path / "lab", tmp_path / "out"
    with Learner.named(str(path), trains=False) as learner:
        table = SmallTable()
        for _ in range(7):
            learner.observe(table.push())
    out.mkdir()
    (out / name).write_text("mine")
    action = "export" if name == "belief.json" else "show"
    with pytest.raises(OutputError, match=f"{name} exists, and no list of SAIN names it"):
        sain_lab(action, str(path), out=out)
    assert files(out) == [name] and (out / name).read_text() == "mine"
    assert name in sain_lab(action, str(path), out=out, overwrite=True)
    assert name in sain_lab(action, str(path), out=out)


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
    assert numbers(path) == [0, 2]


def test_what_cannot_be_written_is_said(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    with pytest.raises(OutputError, match=r"file is not a folder; choose another"):
        OpenLaboratory(blocked / "mine")
    OpenLaboratory(tmp_path / "lab").close()
    (tmp_path / "lab" / LOG).rename(tmp_path / LOG)
    (tmp_path / "lab" / LOG).symlink_to(tmp_path / LOG)
    with pytest.raises(OutputError, match=f"{LOG} is a symbolic link, which is never replaced"):
        OpenLaboratory(tmp_path / "lab")


@pytest.mark.parametrize("action", ["add", "replay"])
@pytest.mark.parametrize(
    ("name", "make", "why"),
    [
        ("none", lambda path: None, "none does not exist; give a bag, or a folder of shard"),
        ("empty", lambda path: path.mkdir(), "empty"),
        ("text.mcap", lambda path: path.write_text("notes"), "text.mcap"),
    ],
)
def test_a_recording_that_is_refused_makes_no_laboratory(tmp_path, action, name, make, why):
    make(tmp_path / name)
    mine, path = str(tmp_path / "mine"), str(tmp_path / name)
    with pytest.raises(DatasetError, match=why):
        if action == "add":
            sain_lab("add", mine, path)
        else:
            sain_lab("replay", path, laboratory=mine)
    with pytest.raises(DatasetError, match=r"no laboratory at .*mine; there are: .*--learn"):
        sain_lab("add", mine)  # what it received
    assert not (tmp_path / "mine").exists()
