"""The shipped contract of rosetta gives the keys, names and numbers of our LeRobot data sets."""

import json
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from pyarrow import parquet

from sain_bags.reading.reader import Bag
from sain_core import wire
from sain_core.errors import InvalidInputError
from sain_core.ros import rosetta
from sain_sim.commands import sim_node
from tests.paths import ROOT
from tests.sain_bags.dataset.formats.exported import drive, to

CONTRACT = ROOT / "src/sain_bringup/config/rosetta.yaml"
ALLOWED = {  # doc/reference/contract.md of rosetta 0.2
    "contract": {"robot_type", "robot_interface", "fps", "observations", "actions", "adjunct"},
    "source": {"channel", "align", "select", "apply", "kind"},
    "channel": {"topic", "type", "qos", "dtype", "decoder", "encoder", "safety"},
    "align": {"strategy", "timeline", "tolerance_ms"},
}


def contract() -> dict[str, Any]:
    read: dict[str, Any] = yaml.safe_load(CONTRACT.read_text())
    return read


def sources() -> dict[str, dict[str, Any]]:
    return contract()["observations"] | contract()["actions"]


def codec(key: str, kind: str) -> Any:
    module, _, name = sources()[key]["channel"][kind].partition(":")
    return getattr(import_module(module), name)


def spec(key: str) -> Any:
    return SimpleNamespace(names=tuple(sources()[key]["select"]))


def test_it_has_the_documented_schema_and_our_topics() -> None:
    assert contract().keys() <= ALLOWED["contract"]
    channels = [one["channel"] for one in (*sources().values(), *contract()["adjunct"])]
    for key, source in sources().items():
        assert source.keys() <= ALLOWED["source"], key
        assert source["align"].keys() <= ALLOWED["align"], key
        assert "images" not in key or "resize" in source["apply"][0]  # which images must have
    topics = {"/sain/goal"} | {
        f"/sain/{one}" for one in (*sim_node.publishes, *sim_node.subscribes)
    }
    for channel in channels:
        assert channel.keys() <= ALLOWED["channel"]
        assert channel["topic"] in topics
        package, kind, name = channel["type"].split("/")
        assert getattr(import_module(f"{package}.{kind}"), name)


@pytest.mark.skipif(find_spec("rosetta") is None, reason="rosetta is on no package index")
def test_its_own_parser_reads_it() -> None:
    assert import_module("rosetta.contract.schema").load_contract(CONTRACT).fps == 1


def test_codecs_give_the_numbers_of_the_data_set_to_the_bit(record: Any, tmp_path: Path) -> None:
    bag = drive(record)
    out = to("lerobot", bag, tmp_path / "out")
    info = json.loads((out / "meta/info.json").read_text())
    for key, source in sources().items():
        assert "images" in key or info["features"][key]["names"] == source["select"], key
    assert info["fps"] == contract()["fps"]
    (data,) = (out / "data").rglob("*.parquet")
    rows = {row["push_id"]: row for row in parquet.read_table(data).to_pylist()}
    goal: Any = None
    for one in Bag(bag).messages():
        if one.topic == "/sain/goal":
            key = "observation.environment_state"
            goal = codec(key, "decoder")(one.message, spec(key)).tolist()
        if one.topic != "/sain/push_result" or one.message.push_id not in rows:
            continue
        row, result = rows[one.message.push_id], one.message
        state = codec("observation.state", "decoder")(result.before, spec("observation.state"))
        push = codec("action", "decoder")(result.push, spec("action"))
        assert state.tolist() == row["observation.state"]
        assert push.tolist() == row["action"]
        assert goal == row["observation.environment_state"]
        sent = codec("action", "encoder")(push, spec("action"), 5)
        assert wire.decode_push(sent).tolist() == row["action"]
        ids = result.before.episode_id, result.before.scene_id
        assert (sent.episode_id, sent.scene_id, sent.header.stamp.nanosec) == (*ids, 5)


def test_another_number_of_bodies_and_a_push_without_a_scene_are_errors(
    messages: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rosetta, "_seen", [])
    scene = messages.make("sain_interfaces/msg/Scene", disks=messages.disks(np.full((1, 8), 0.1)))
    with pytest.raises(InvalidInputError, match="has 1 bodies; the contract selects 16 numbers"):
        rosetta.decode_state(scene, spec("observation.state"))
    with pytest.raises(InvalidInputError, match="no scene was decoded yet"):
        rosetta.encode_push([0.0] * 5, spec("action"))
