"""A learner as a process: pushes come faster than it learns, and it ends, is killed, or trains."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rclpy

from sain_core.cli.command_line import executable
from sain_core.errors import ErrorCode
from sain_core.push import LENGTH, PushLimits
from sain_core.ros import codec
from sain_core.ros.qos import QUEUE
from sain_core.scene import make_scene
from sain_interfaces.msg import PushResult
from sain_lab.storage.laboratory import Laboratory
from sain_model.physics.parameters import TEXTBOOK
from sain_model.physics.planar import PlanarPrior

COUNT = 120
SCENE = make_scene(
    np.array([(0.42, 0.0), (0.56, 0.02)]), np.array([8.0, 8.0]), np.array([0.08, 0.06])
)


def results() -> list[PushResult]:
    """Return results of pushes from one scene, each an episode of its own."""
    pushes = PushLimits().sample(np.random.default_rng(0), COUNT)
    pushes[:, LENGTH] = 0.03 + pushes[:, LENGTH] / 3
    ends = PlanarPrior(TEXTBOOK).step(np.repeat(SCENE[None], COUNT, axis=0), pushes)
    stamp, found = codec.encode_time(0), []
    for number, (push, after) in enumerate(zip(pushes, ends, strict=True), 1):
        ids = {"episode_id": number, "scene_id": number}
        found.append(
            PushResult(
                push_id=number,
                episode_id=number,
                error_code=ErrorCode.OK,
                push=codec.encode_push(push, stamp=stamp, push_id=number, source="test", **ids),
                before=codec.encode_scene(SCENE, stamp=stamp, settled=True, **ids),
                after=codec.encode_scene(after, stamp=stamp, settled=True, **ids),
            )
        )
    return found


def start(path: Path) -> "subprocess.Popen[str]":
    command = [str(executable("sain_lab", "learner_node")), "--ros-args"]
    command += ["-p", f"laboratory:={path}", "-p", "trains:=false"]
    return subprocess.Popen(command, stderr=subprocess.PIPE, text=True)


def learned(path: Path) -> list[str]:
    try:
        records = list(Laboratory(path).records())
    except Exception:  # noqa: BLE001 - there is none yet
        return []
    return [one["digest"] for one in records if one["kind"] == "push"]


@pytest.mark.system
def test_what_a_learner_had_no_time_for_is_learned_by_the_next(ros_domain, tmp_path):
    path = tmp_path / "lab"
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros_domain)
    node = rclpy.create_node("bystander", namespace="sain", context=context)
    publisher = node.create_publisher(PushResult, "push_result", QUEUE)
    with start(path) as first:
        try:
            while not publisher.get_subscription_count():
                time.sleep(0.05)
            for message in results():
                publisher.publish(message)
            assert publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=30))
        finally:
            first.send_signal(signal.SIGINT)
            said = first.communicate(timeout=100)[1]
            node.destroy_node()
            context.try_shutdown()
    before = len(learned(path))
    assert before + waits(said) == COUNT
    with start(path) as second:
        try:
            end = time.monotonic() + 100.0
            while len(learned(path)) < before + 3:
                assert time.monotonic() < end, len(learned(path))
                time.sleep(0.5)
        finally:
            second.send_signal(signal.SIGINT)
            ended = second.communicate(timeout=100)[1]
    assert f"{waits(said)} more were received before" in ended
    assert len(set(learned(path))) == len(learned(path)) == COUNT - waits(ended)


def waits(said: str) -> int:
    """Return how many pushes a learner has left, as it said."""
    pattern = r"(\d+) pushes wait in \S+waiting.log: the next learner begins"
    (count,) = re.findall(pattern, said)
    return int(count)


@pytest.mark.system
def test_a_training_ends_with_the_process_that_began_it(tmp_path):
    """Kill a process that has begun a training; what it trains on does not matter."""
    code = (
        "import time; from pathlib import Path; from sain_lab.network_training import Training;"
        "from sain_lab.storage.laboratory import OpenLaboratory;"
        f"one = Training.start(OpenLaboratory(Path({str(tmp_path / 'lab')!r})), 50);"
        "print(one._process.pid, flush=True); time.sleep(600)"
    )
    slow = os.environ | {"PYTHONPATH": f"{slowly(tmp_path)}:{os.environ.get('PYTHONPATH', '')}"}
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=slow) as parent:
        try:
            training = int(parent.stdout.readline())
            end = time.monotonic() + 120.0
            while not (tmp_path / "trains").exists():
                assert time.monotonic() < end
                time.sleep(0.05)
        finally:
            parent.kill()
    while Path(f"/proc/{training}").exists() and time.monotonic() < end:
        state = Path(f"/proc/{training}/stat").read_text().rsplit(")", 1)[1].split()[0]
        if state == "Z":
            break
        time.sleep(0.05)
    else:
        assert not Path(f"/proc/{training}").exists()


def slowly(folder: Path) -> Path:
    """Return a folder for PYTHONPATH that makes `torch` take a minute to be imported."""
    text = f"import pathlib, time\npathlib.Path({str(folder / 'trains')!r}).touch()\n"
    (folder / "torch.py").write_text(text + "time.sleep(60)\n")
    return folder
