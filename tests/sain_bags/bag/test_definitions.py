"""Definitions carry all they refer to."""

from pathlib import Path

import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sain_bags.bag.definitions import SEPARATOR, Definitions
from sain_core.errors import InvalidInputError


def install(prefix: Path, name: str, text: str) -> None:
    package, _, short = name.split("/")
    folder = prefix / "share" / package / "msg"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{short}.msg").write_text(text, encoding="utf-8")


def test_joined_appends_each_dependency_once(tmp_path: Path) -> None:
    install(tmp_path, "a/msg/Outer", "Inner one\nInner[3] more\nb/Leaf leaf\nuint8 N = 3\n")
    install(
        tmp_path, "a/msg/Inner", "# about\nb/msg/Leaf[<=4] leaves  # up to four\nstring<=9 name\n"
    )
    install(tmp_path, "b/msg/Leaf", "float64[2] xy\nwstring w\n")
    joined = Definitions((tmp_path,)).joined("a/msg/Outer")
    assert joined.split("\n")[0] == "Inner one"
    assert [line for line in joined.splitlines() if line.startswith("MSG: ")] == [
        "MSG: a/msg/Inner",
        "MSG: b/msg/Leaf",
    ]
    assert joined.count(SEPARATOR) == 2
    assert len(SEPARATOR) == 80


def install_service(prefix: Path, name: str, text: str) -> None:
    folder = prefix / "share" / "a" / "srv"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.srv").write_text(text, encoding="utf-8")


def test_service_events_are_defined_by_their_service(tmp_path: Path) -> None:
    install(tmp_path, "a/msg/Inner", "float64 x\n")
    install(tmp_path, "service_msgs/msg/ServiceEventInfo", "uint8 event_type\n")
    install_service(tmp_path, "Ask", "# Inner\nInner[] things\nstring<=9 name\n---\nbool done\n")
    install_service(tmp_path, "Trigger", "---\nbool done  # or not\n")
    definitions = Definitions((tmp_path,))
    assert definitions.text("a/srv/Ask_Request") == "# Inner\na/Inner[] things\nstring<=9 name\n"
    assert definitions.text("a/srv/Ask_Response") == "bool done\n"
    assert definitions.text("a/srv/Trigger_Request") == "\n"
    assert definitions.text("a/srv/Trigger_Response") == "bool done  # or not\n"
    types = get_types_from_msg(definitions.joined("a/srv/Ask_Event"), "a/srv/Ask_Event")
    store = get_typestore(Stores.EMPTY)
    store.register(types)  # raises when one is missing
    assert set(types) == {
        "a/msg/Inner", "a/srv/msg/Ask_Event", "a/srv/msg/Ask_Request", "a/srv/msg/Ask_Response",
        "service_msgs/msg/ServiceEventInfo",
    }  # fmt: skip


def test_missing_definition_names_type_and_where_it_was_sought(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match=f"a/msg/M is installed; searched {tmp_path}"):
        Definitions((tmp_path,)).text("a/msg/M")
