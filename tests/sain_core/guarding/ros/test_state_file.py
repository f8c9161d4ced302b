"""What is no state of a node is refused in one line: its path, why, and what to do."""

import os
from pathlib import Path

import pytest

from sain_core.errors import DatasetError, OutputError
from sain_core.guarding.ros.state_file import StateFile, id_in, message_of
from sain_interfaces.msg import Push


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{]", "is not the state of a node: Expecting property name"),
        ("[1]", "is not the state of a node: it is no object"),
        ('{"id": 1e400}', "is not the state of a node: the number 1e400 is too large"),
        ('{"id": Infinity}', "is damaged: cannot convert float infinity to integer"),
        ('{"id": NaN}', "is damaged: cannot convert float NaN to integer"),
        ('{"id": -1}', "is damaged: id is -1; allowed: 0 to 18446744073709551615"),
        ('{"id": 1e300}', "is damaged: id is 1"),
        ('{"id": []}', r"is damaged: int\(\) argument must be"),
        ('{"push": ""}', "is damaged: it has no 'id'"),
        ('{"id": 1, "push": "?"}', "is damaged: no message of type Push"),
    ],
)
def test_a_state_that_is_none_is_refused_with_its_path(graph, tmp_path, text, why):
    path = tmp_path / "node.json"
    path.write_text(text)
    file = StateFile(graph.bystander, str(path))
    with pytest.raises(DatasetError, match=rf"^{path} {why}.*remove it to begin anew$") as caught:
        state = file.read()
        with file.decoding():
            id_in(state, "id")
            message_of(Push, state["push"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "make"),
    [
        ("a FIFO", os.mkfifo),
        ("a folder", Path.mkdir),
        ("a symbolic link", lambda path: path.symlink_to(path.parent / "victim")),
    ],
)
def test_links_folders_and_pipes_are_no_place_for_a_state(graph, tmp_path, kind, make):
    path = tmp_path / "node.json"
    make(path)
    file, before = StateFile(graph.bystander, str(path)), path.lstat()
    with pytest.raises(OutputError, match=f"node.json is {kind}, which is never replaced"):
        file.read()
    file.write(id=1)  # is logged as an error
    assert (path.lstat().st_ino, path.lstat().st_mode) == (before.st_ino, before.st_mode)
    assert [one.name for one in tmp_path.iterdir()] == ["node.json"]
