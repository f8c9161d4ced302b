"""Hostile input: mutated files through the commands that read them, spoilt messages to the nodes.

A command reads a file, or refuses it with one line and exit code 1 or 2, within 10 s of the
processor and 1 GB. A node answers each request, and lives.
"""

import ast
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from subprocess import DEVNULL
from typing import Any, Final

import numpy as np
import rclpy
from rclpy.node import Node

from benchmarks.faults.running import own_domain
from benchmarks.faults.table import Row
from benchmarks.speed.made_bags import MadeBag
from sain_bags.dataset.conversion import convert
from sain_core.cli.command_line import load
from sain_core.push import idle_pushes
from sain_core.randomness import generator
from sain_core.ros import codec
from sain_core.ros.node_main import command_node
from sain_core.scene import make_scene
from sain_interfaces import msg, srv
from sain_model.dynamics.load import shipped_checkpoint

Random = np.random.Generator
MOST_SECONDS: Final = 10.0  # of the processor
PATIENCE: Final = 60.0  # [s]
AT_ONCE: Final = 8  # calls; a service keeps ten that it has not taken yet
STARTS: Final = 300.0  # [s], which may include that kernels are compiled
MEMORY: Final = 1 << 30  # [bytes], more than this process has
LARGEST: Final = (1 << 64) - 1
PACKAGES: Final = {"sim_node": "sain_sim", "model_node": "sain_model", "mppi_node": "sain_mppi"}
TEXTS: Final = ("../../etc/passwd", "%s%n", "\x1b[31m\n", "x" * 100_000)
FLOATS: Final = (float("nan"), float("inf"), -1e308)
LENGTHS: Final = (0, 11, 1000)
INTEGER: Final = re.compile(r"(u?)int(\d+)")
SEQUENCE: Final = re.compile(r"sequence<(.+?)(?:, (\d+))?>")


# --- files ----------------------------------------------------------------------------------------


def mutate(content: bytes, random: Random) -> bytes:
    """Return a content with one to eight random changes."""
    changed = bytearray(content)
    for _ in range(int(random.integers(1, 9))):
        place, size = int(random.integers(len(changed) + 1)), int(random.integers(1, 64))
        end, new = (
            (len(changed), b"\0"),  # cut off
            (place + size, random.bytes(size)),
            (place + 8, LARGEST.to_bytes(8, "little")),  # a length, perhaps
            (place, random.bytes(size)),
            (place + size, b""),
        )[int(random.integers(5))]
        changed[place:end] = new
    return bytes(changed)


def good_files(folder: Path) -> dict[Path, tuple[str, ...]]:
    """Make a bag, a data set and a checkpoint; return what to mutate, and what then reads it."""
    made = MadeBag(folder / "bag")
    made.pushes(24)
    made.writer.close()
    convert([folder / "bag"], folder / "data")
    shipped, model = Path(str(shipped_checkpoint())), folder / "model.safetensors"
    for suffix in (".safetensors", ".json"):
        model.with_suffix(suffix).write_bytes(shipped.with_suffix(suffix).read_bytes())
    bag, data = str(folder / "bag"), str(folder / "data")
    readers = (f"sain_bags info {bag}", f"sain_bags to_dataset {bag} --out {folder / 'out'}")
    evaluate = f"sain_model evaluate {data} --checkpoint {model}"
    return {
        next((folder / "bag").glob("*.mcap")): readers,
        folder / "bag" / "metadata.yaml": readers,
        next((folder / "data").glob("shard-*.npz")): (f"sain_model evaluate {data}",),
        model: (evaluate,),
        model.with_suffix(".json"): (evaluate,),
    }


def files(folder: Path, count: int, seed: int) -> Row:
    """Mutate good files, and run the commands that read them."""
    good = good_files(folder)
    runs = right = 0
    for number in range(count):
        path = list(good)[number % len(good)]
        content = path.read_bytes()
        path.write_bytes(mutate(content, generator(seed, path.name, number)))
        for line in good[path]:
            problem = problem_of(line)
            runs, right = runs + 1, right + (not problem)
            if problem:
                print(f"file {number}: {line}: {problem}", flush=True)
        path.write_bytes(content)
    note = f"survived: read or refused in one line, within {MOST_SECONDS:g} s and 1 GB"
    return Row(f"{count:,} mutated files", runs, right, 0, note=note)


def problem_of(line: str) -> str:
    """Run a command in its own process; return what is wrong with how it ended; empty: nothing."""
    package, name, *arguments = line.split()
    entry = load(f"{package} x", f"commands:{name}")
    source = ast.parse(Path(entry.file.__file__ or "").read_text(encoding="utf-8"))
    for one in ast.walk(source):  # imported late; here, and not once more in each child
        if isinstance(one, ast.ImportFrom) and one.module:
            import_module(one.module)
    with tempfile.TemporaryFile() as output:
        sys.stdout.flush()
        child = os.fork()
        if not child:
            _be_child(lambda: entry(arguments), output.fileno())
        end, ended = time.monotonic() + PATIENCE, 0
        while not ended and time.monotonic() < end:
            ended, status, usage = os.wait4(child, os.WNOHANG)
            time.sleep(0.005)
        if not ended:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return "no end"
        output.seek(0)
        text = output.read().decode(errors="replace").strip()
    code = os.waitstatus_to_exitcode(status)
    lines = [one for one in text.splitlines() if not one.startswith("[WARN]")]
    if usage.ru_utime + usage.ru_stime > MOST_SECONDS:
        return f"{usage.ru_utime:.0f} s"
    tidy = code == 0 or (code in (1, 2, 3) and len(lines) == 1)
    return "" if tidy else f"exit code {code}: {text[-500:]}"


def _be_child(run: Callable[[], int | None], output: int) -> None:
    code = 70
    try:
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(output, 2)
        code = run() or 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:  # noqa: BLE001
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stderr.flush()
        os._exit(code)


# --- messages -------------------------------------------------------------------------------------


def requests() -> dict[str, list[tuple[str, Any, Any]]]:
    """Return what nodes take: names of topics and services, their types, and valid messages."""
    places = np.array([(0.40, 0.0), (0.541, 0.0)])
    scene = make_scene(places, np.array([8.0, 8.0]), np.array([0.08, 0.06]))
    disks, stamp = codec.encode_disks(scene), codec.encode_time(0)
    flat, pushes = codec.encode_floats(scene), codec.encode_floats(idle_pushes(4))
    rollout = srv.Rollout.Request(samples=2, horizon=2, disks=2, scene=flat, pushes=pushes)
    seen = codec.encode_scene(scene, stamp=stamp, episode_id=1, scene_id=1, settled=True)
    push = msg.Push(episode_id=1, scene_id=1, length=0.1, source="flood", disks=disks)
    result = msg.PushResult(push=push, before=seen, after=seen, episode_id=1, push_id=1)
    return {
        "sim_node": [
            ("push", msg.Push, push),
            ("reset_scene", srv.ResetScene, srv.ResetScene.Request(disks=disks)),
        ],
        "model_node": [
            ("rollout", srv.Rollout, rollout),
            ("load_model", srv.LoadModel, srv.LoadModel.Request(model="planar")),
        ],
        "mppi_node": [("scene", msg.Scene, seen), ("push_result", msg.PushResult, result)],
    }


def spoilt(value: Any, kind: str, random: Random) -> Any:
    """Return another value for a field of this type, which hardly any honest sender sends."""
    if found := SEQUENCE.fullmatch(kind):
        if not len(value):
            return value
        element = spoilt(deepcopy(value[0]), found[1], random)
        return [element] * min(int(random.choice(LENGTHS)), int(found[2] or LENGTHS[-1]))
    if kind in ("double", "float"):
        return float(random.choice(FLOATS if kind == "double" else FLOATS[:2]))
    if kind == "boolean":
        return not value
    if kind.startswith("string"):
        return TEXTS[random.integers(len(TEXTS))]
    if found := INTEGER.fullmatch(kind):
        return 2 ** (int(found[2]) - (not found[1])) - 1
    if hasattr(value, "get_fields_and_field_types"):
        inner = value.get_fields_and_field_types()
        name = str(random.choice(sorted(inner)))
        setattr(value, name, spoilt(getattr(value, name), inner[name], random))
    return value


@own_domain()
def messages(name: str, count: int, seed: int) -> Row:
    """Start a node in its own domain, send it spoilt messages; return how many it answered."""
    code = f"import sys; from {PACKAGES[name]}.commands import {name}; sys.exit({name}())"
    command = [sys.executable, "-c", code]
    command += ["--ros-args", "-p", "model:=planar"] if name == "model_node" else []
    sent = answered = 0
    process = subprocess.Popen(command, stdout=DEVNULL, stderr=DEVNULL)
    with command_node("flooder") as node, process:
        try:
            for topic, kind, valid in requests()[name]:
                random = generator(seed, topic)
                some = [spoilt(deepcopy(valid), "", random) for _ in range(count)]
                send = called if hasattr(kind, "Request") else published
                sent += count
                answered += send(node, topic, kind, some)
            died = process.poll() is not None
        finally:
            process.terminate()
    return Row(f"hostile messages: {name}", sent, answered, int(died))


def called(node: Node, topic: str, kind: Any, some: list[Any]) -> int:
    """Call a service; return how many calls it answered."""
    client = node.create_client(kind, topic)
    spin(node, client.service_is_ready, STARTS)
    futures: list[Any] = []
    for one in some:
        spin(node, lambda: sum(not future.done() for future in futures) < AT_ONCE)
        futures.append(client.call_async(one))
    spin(node, lambda: all(one.done() for one in futures))
    return sum(one.done() for one in futures)


def published(node: Node, topic: str, kind: Any, some: list[Any]) -> int:
    """Publish; return how many pushes had a result, or how many of another topic were sent."""
    results: list[msg.PushResult] = []
    publisher = node.create_publisher(kind, topic, len(some))
    if topic == "push":
        node.create_subscription(msg.PushResult, "push_result", results.append, len(some))
    spin(node, publisher.get_subscription_count, STARTS)
    for number, one in enumerate(some):
        if topic == "push":
            one.push_id = number + 1
        publisher.publish(one)
    spin(node, lambda: topic != "push" or len(results) >= len(some))
    return len({one.push_id for one in results}) if topic == "push" else len(some)


def spin(node: Node, done: Callable[[], object], longest: float = PATIENCE) -> None:
    """Handle what comes until something is so, but not for ever [s]."""
    end = time.monotonic() + longest
    while not done() and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.05)
