"""Friction is in the rows of an episode that a recorded call of the simulator told of."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import get_types_from_msg

from sain_bags.conversion import convert
from sain_bags.definitions import SEPARATOR
from sain_bags.metadata import Topic
from sain_bags.parameters import RESET
from sain_model.dataset import load_transitions
from tests.sain_bags.driven import BLOCKED, OK, Drive

SERVICE = Path(__file__).resolve().parents[2] / "src/sain_interfaces/srv/ResetScene.srv"
REFERRED = (
    "builtin_interfaces/msg/Time", "sain_interfaces/msg/DiskState", "sain_interfaces/msg/Scene",
    "service_msgs/msg/ServiceEventInfo", "std_msgs/msg/Header",
)  # fmt: skip
NAME = "sain_interfaces/msg/ResetSceneEvent"  # of the event, for rosbags


class Calls:
    """Records calls of ``reset_scene`` as service introspection publishes them."""

    def __init__(self, recording: Any, namespace: str = "/sain") -> None:
        self.recording, self.messages = recording, recording.messages
        self.name = f"{namespace}/reset_scene/_service_event"
        text = self._definition()
        recording.writer.add_topic(Topic(self.name, RESET, text))
        renamed = text.replace("ResetScene_", "ResetScene").replace("/srv/", "/msg/")
        if NAME not in self.messages.store.types:
            self.messages.store.register(get_types_from_msg(renamed, NAME))
        self.calls = 0

    def reset(self, episode: int, friction: float, code: int = OK, contents: bool = True) -> None:
        """Record a call and its answer."""
        make = self.messages.make
        scene = make("sain_interfaces/msg/Scene", episode_id=episode)
        request = make("sain_interfaces/msg/ResetSceneRequest", friction=friction, seed=3)
        response = make("sain_interfaces/msg/ResetSceneResponse", error_code=code, scene=scene)
        self.calls += 1
        self._event(1, request=[request] if contents else [])
        self._event(2, response=[response] if contents else [])

    def _event(self, kind: int, **fields: Any) -> None:
        caller = np.full(16, 7, dtype=np.uint8)
        info = self.messages.make(
            "service_msgs/msg/ServiceEventInfo",
            event_type=kind, client_gid=caller, sequence_number=self.calls,
        )  # fmt: skip
        event = self.messages.make(NAME, info=info, **fields)
        data = bytes(self.messages.store.serialize_cdr(event, NAME))
        self.recording.now += 1
        self.recording.writer.write(self.name, data, self.recording.now, self.recording.now)

    def _definition(self) -> str:
        request, response = SERVICE.read_text().split("---")
        parts = {
            "sain_interfaces/srv/ResetScene_Request": request,
            "sain_interfaces/srv/ResetScene_Response": response,
        }
        qualified = {
            name: text.replace("DiskState[]", "sain_interfaces/DiskState[]").replace(
                "Scene scene", "sain_interfaces/Scene scene"
            )
            for name, text in parts.items()
        }
        qualified |= {name: self.messages.definitions.text(name) for name in REFERRED}
        text = "service_msgs/ServiceEventInfo info\n"
        text += "ResetScene_Request[<=1] request\nResetScene_Response[<=1] response\n"
        for name, part in qualified.items():
            text += f"{SEPARATOR}\nMSG: {name}\n{part}\n"
        return text


def frictions(out: Path) -> list[float]:
    return load_transitions(out).friction.tolist()


def test_rows_have_the_friction_that_a_call_asked_for(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record()
    calls, driver = Calls(recording), Drive(recording)
    for episode, friction in ((1, 0.15), (2, 0.0), (3, 0.09)):
        calls.reset(episode, friction)
        driver.episode(episode, [10 * episode, 10 * episode + 1])
    calls.reset(4, 0.2, code=BLOCKED)
    driver.episode(4, [40])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    np.testing.assert_array_equal(
        frictions(tmp_path / "out"), [0.15, 0.15, np.nan, np.nan, 0.09, 0.09, np.nan]
    )


def test_a_simulator_that_was_started_anew_makes_a_number_ambiguous(
    record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record()
    calls = Calls(recording)
    for run, friction in enumerate((0.1, 0.2)):
        calls.reset(1, friction)
        Drive(recording, seed=run).episode(1, [10 * run + 1])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    assert np.isnan(frictions(tmp_path / "out")).all()


@pytest.mark.parametrize(("namespace", "contents"), [("/other", True), ("/sain", False)])
def test_another_graph_and_calls_without_contents_tell_nothing(
    namespace: str, contents: bool, record: Callable[..., Any], tmp_path: Path
) -> None:
    recording = record()
    calls = Calls(recording, namespace)
    calls.reset(1, 0.1, contents=contents)
    Drive(recording).episode(1, [1, 2])
    recording.writer.close()
    convert([recording.writer.folder], tmp_path / "out")
    assert np.isnan(frictions(tmp_path / "out")).all()


def test_every_bag_has_its_own_numbers(record: Callable[..., Any], tmp_path: Path) -> None:
    bags = []
    for name, seed in (("told", 0), ("untold", 1)):
        recording = record(name)
        if name == "told":
            Calls(recording).reset(1, 0.11)
        Drive(recording, seed=seed).episode(1, [1])
        recording.writer.close()
        bags.append(recording.writer.folder)
    convert(bags, tmp_path / "out")
    np.testing.assert_array_equal(frictions(tmp_path / "out"), [0.11, np.nan])
    convert(bags[1:], tmp_path / "none")
    assert "friction" not in np.load(tmp_path / "none" / "shard-00000.npz")
