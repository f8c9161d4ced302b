"""Nothing is lost from tick to policy: each step is killed at random moments, and goes on.

A step is recording (its writer, with splits), `to_dataset` to npz and to LeRobot with images as
video, or `sain_model train`. It runs in a fork of this process, which is killed (SIGKILL) at a
random moment of its usual duration; sometimes so is the second call. Then the same call ends it.

* **recording**: all messages that were flushed are in one bag, to the bit and in order.
* **to_dataset**: the folder never looks whole before it is; every file ends as that of a run
  without a kill, to the byte. Values of that run are compared with the bag's, to the bit; the video
  with the images (the codec's loss is stated); `lerobot-doctor`, where it is on the PATH, finds no
  fault in it.
* **train**: the checkpoint ends as that of a run without a kill, to the byte.
* **damage**: a bag or a shard is cut off, or some of its bytes are changed. `recover` copies
  messages that are the bag's, to the bit; a damaged shard is refused, or made anew.

The results of tries are kept in a file: the same command goes on where it was stopped.
"""

import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import av
import numpy as np
from pyarrow import parquet
from rich.console import Console

from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.speed.made_bags import MadeBag
from sain_bags.bag.metadata import Topic, TopicQos
from sain_bags.dataset.conversion import convert
from sain_bags.dataset.dataset_folder import CARD_FILE
from sain_bags.dataset.formats import to_lerobot  # noqa: F401  what each fork needs is loaded once
from sain_bags.dataset.rows import ConversionConfig
from sain_bags.reading.reader import Bag
from sain_bags.recovery import make_whole, recover
from sain_bags.writing.writer import BagConfig, BagWriter
from sain_core.errors import SainError
from sain_core.output import MANIFEST, append_json
from sain_core.scene import STATE_NAMES
from sain_model.cli import train
from sain_model.training.settings import TrainingConfig, TrainOptions

MESSAGES: Final = 4000  # of a recording
FLUSHED: Final = 50  # messages between two flushes
TEXT: Final = Topic("/text", "std_msgs/msg/String", "string data\n", "", (TopicQos(),))
STEPS: Final = ("recording", "npz", "lerobot", "train", "damage")
SHAPE: Final = (96, 128, 3)  # of images
KEY: Final = "observation.images.camera_color"
AGAIN: Final = 0.3  # share of tries whose second call is killed, too
LOGS: Final = {MANIFEST}  # a line for each write, more of them after a kill


@dataclass(frozen=True)
class Options(ReportOptions):
    """How often each step is killed or damaged."""

    recording: int = 450
    npz: int = 340
    lerobot: int = 90
    train: int = 20
    damage: int = 100
    pushes: int = 60
    """in the bag that becomes a data set"""
    kept: Path = Path("results/losses.jsonl")
    """file of the tries so far"""
    seed: int = 0


class Fork:
    """A call in a process of its own."""

    def __init__(self, call: Callable[[], object]) -> None:
        """Begin it."""
        self.began = time.monotonic()
        self._process = os.fork()
        if not self._process:
            code = 1
            try:
                with Path(os.devnull).open("w") as nothing:
                    os.dup2(nothing.fileno(), 1)
                call()
                code = 0
            except SainError as error:
                os.write(2, f"{error}\n".encode())
            finally:
                os._exit(code)

    def kill(self, after: float) -> bool:
        """Kill it so long after its start [s]; return whether it still ran."""
        time.sleep(max(0.0, self.began + after - time.monotonic()))
        os.kill(self._process, signal.SIGKILL)
        return os.WIFSIGNALED(os.waitpid(self._process, 0)[1])

    def end(self) -> tuple[bool, float]:
        """Wait for it; return whether it succeeded, and how long it took [s]."""
        ended = os.waitpid(self._process, 0)[1]
        return ended == 0, time.monotonic() - self.began


# --- recording ------------------------------------------------------------------------------------


def message(number: int) -> bytes:
    """Return the CDR of a message that tells its number, of 8 to 300 bytes."""
    text = f"{number:08d}" * (1 + number % 37)
    return b"\x00\x01\x00\x00" + (len(text) + 1).to_bytes(4, "little") + text.encode() + b"\x00"


def record(folder: Path, first: int, flushed: Path) -> None:
    """Record messages from a number on, as after a crash, and end the bag."""
    config = BagConfig(split_size=60_000, chunk_size=4_000)
    with flushed.open("ab", buffering=0) as file:
        with BagWriter(folder, config, resumes=True) as writer:
            writer.add_topic(TEXT)
            for number in range(first, MESSAGES):
                writer.write(TEXT.name, message(number), 1 + number, sequence=1 + number)
                if number % FLUSHED == FLUSHED - 1:
                    writer.flush()
                    file.write(f"{number} ".encode())
        file.write(f"{MESSAGES - 1} ".encode())
    make_whole(folder)


def check_recording(folder: Path, flushed: list[int], resumed: list[int]) -> str:
    """Return what is wrong with a bag, or nothing."""
    found = [(raw.sequence - 1, raw.data) for raw in Bag(folder).raw_messages()]
    if wrong := [number for number, data in found if data != message(number)]:
        return f"message {wrong[0]} differs"
    numbers = [number for number, _ in found]
    lost = {*range(max(flushed) + 1)} - {*numbers}
    lost |= {number for first, last in zip(resumed, flushed, strict=False)
             for number in range(first, last + 1)} - {*numbers}  # fmt: skip
    if lost:
        return f"{len(lost)} flushed messages are lost, from {min(lost)} on"
    order = [raw.log_time for raw in Bag(folder).raw_messages()]
    return "" if all(a <= b for a, b in pairwise(order)) else "out of order"


def try_recording(folder: Path, usual: float, random: np.random.Generator) -> str | None:
    """Kill a recording once or twice, end it, and return what was lost; None: it was too fast."""
    bag, told, next_one = folder / "bag", folder / "flushed", 0
    told.write_bytes(b"")
    starts, ends = [], []
    for kill in range(1 + int(random.random() < AGAIN)):
        if not Fork(partial(record, bag, next_one, told)).kill(random.uniform(0, usual)):
            if not kill:
                return None
            break
        words = told.read_text().split(" ")[:-1]
        last = int(words[-1]) if words else -1
        starts.append(next_one)
        ends.append(last)
        next_one = last + 1
    else:
        if not bag.exists() and next_one:
            return "the bag is gone"
        if next_one < MESSAGES and not Fork(partial(record, bag, next_one, told)).end()[0]:
            return "the second call failed"
        if next_one >= MESSAGES and not Fork(partial(make_whole, bag)).end()[0]:
            return "the second call failed"
    return check_recording(bag, [*ends, MESSAGES - 1], [*starts, next_one])


# --- to_dataset and train -------------------------------------------------------------------------


def contents(folder: Path) -> dict[str, bytes]:
    """Return all files of a result."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {
        str(path.relative_to(folder)): path.read_bytes() for path in files if path.name not in LOGS
    }


def difference(found: dict[str, bytes], wanted: dict[str, bytes]) -> str:
    """Return the first file that differs, or nothing."""
    names = sorted({*found, *wanted})
    return next((f"{one} differs" for one in names if found.get(one) != wanted.get(one)), "")


def try_call(
    call: Callable[[Path], object], wanted: dict[str, bytes], last: str,
    folder: Path, usual: float, random: np.random.Generator,
) -> str | None:  # fmt: skip
    """Kill a call once or twice, make it again, and compare; None: it was too fast."""
    out = folder / "out"
    for kill in range(1 + int(random.random() < AGAIN)):
        if not Fork(partial(call, out)).kill(random.uniform(0, usual)):
            if not kill:
                return None
        elif (out / last).exists() and (out / last).read_bytes() != wanted[last]:
            return f"{last} stands, and is not whole"
    if not Fork(partial(call, out)).end()[0]:
        return "the second call failed"
    return difference(contents(out), wanted)


def to_dataset(bag: Path, format: Any, out: Path) -> None:  # noqa: A002
    """Convert a bag."""
    convert([bag], out, ConversionConfig(format=format))


def make_data(folder: Path) -> None:
    """Make a data set to train on."""
    bag = MadeBag(folder / "bag")
    bag.pushes(400)
    bag.writer.close()
    convert([folder / "bag"], folder / "rows")


def train_network(data: Path, out: Path) -> None:
    """Train a small network for a few epochs."""
    config = TrainingConfig(epochs=2)
    with Path(os.devnull).open("w") as nothing:
        train.run(TrainOptions((data / "rows",), out, training=config), Console(file=nothing))


# --- damage ---------------------------------------------------------------------------------------


def spoil(path: Path, random: np.random.Generator) -> None:
    """Cut a file off, or change a few of its bytes."""
    content = bytearray(path.read_bytes())
    if random.random() < 0.5:
        del content[int(random.integers(len(content))) :]
    else:
        for place in random.integers(len(content), size=int(random.integers(1, 5))).tolist():
            content[place] ^= int(random.integers(1, 256))
    path.write_bytes(content)


def try_damage(
    bag: Path, wanted: dict[str, bytes], folder: Path, random: np.random.Generator
) -> str | None:
    """Damage a bag, recover it and compare its messages; or a shard, and convert again."""
    if random.random() < 0.5:
        return _damaged_bag(bag, folder, random)
    out = folder / "out"
    if not Fork(partial(to_dataset, bag, "npz", out)).end()[0]:
        return "the conversion failed"
    (out / CARD_FILE).unlink()  # as if it had been stopped before
    shards = sorted(out.glob("*.npz"))
    spoil(shards[int(random.integers(len(shards)))], random)
    succeeded, _ = Fork(partial(to_dataset, bag, "npz", out)).end()
    return difference(contents(out), wanted) if succeeded else ""


def _damaged_bag(bag: Path, folder: Path, random: np.random.Generator) -> str:
    copy = folder / bag.name
    shutil.copytree(bag, copy)
    (file,) = copy.glob("*.mcap")
    spoil(file, random)
    with suppress(SainError):
        recover(copy, folder / "saved")
    if not (folder / "saved").exists():
        return ""
    sent = Counter((raw.topic, raw.log_time, raw.data) for raw in Bag(bag).raw_messages())
    saved = Counter(
        (raw.topic, raw.log_time, raw.data) for raw in Bag(folder / "saved").raw_messages()
    )
    return "a recovered message is not the bag's" if saved - sent else ""


# --- references -----------------------------------------------------------------------------------


def make_bag(folder: Path, pushes: int) -> None:
    """Write a bag of pushes, with an image before each and one after it."""
    bag, random = MadeBag(folder, BagConfig(chunk_size=20_000)), np.random.default_rng(1)
    for number in range(1, pushes + 1):
        for _ in range(2):
            bag.images([blocks(random)])
        bag.pushes(1, first=number)
    bag.writer.close()


def blocks(random: np.random.Generator) -> np.ndarray:
    """Return an image (96, 128, 3) of random squares."""
    coarse = random.integers(0, 256, (6, 8, 3), dtype=np.uint8)
    return np.kron(coarse, np.ones((16, 16, 1), dtype=np.uint8))


def check_values(bag: Path, npz: Path, lerobot: Path) -> tuple[int, float]:
    """Compare data sets with the bag; return how many pushes differ, and the video's error."""
    rows = dict[int, list[float]]()
    for path in sorted(npz.glob("*.npz")):
        with np.load(path) as shard:
            rows |= dict(zip(shard["push_id"].tolist(), shard["state"].tolist(), strict=True))
    (table,) = (parquet.read_table(path).to_pylist() for path in lerobot.glob("data/*/*.parquet"))
    frames = {row["push_id"]: row for row in table}
    (video,) = lerobot.glob(f"videos/{KEY}/*/*.mp4")
    with av.open(str(video)) as file:
        shown = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
    image: Any = None
    seen, wrong, errors = dict[int, Any](), 0, list[float]()
    found = Bag(bag)
    for raw in found.raw_messages(["/sain/camera/color/image_raw", "/sain/push"]):
        if raw.topic.endswith("image_raw"):
            image = np.frombuffer(raw.data[-np.prod(SHAPE) :], np.uint8).reshape(SHAPE)
        else:
            seen[len(seen) + 1] = image
    for one in found.messages(["/sain/push_result"]):
        push, result = one.message.push_id, one.message
        state = [getattr(disk, name) for disk in result.before.disks for name in STATE_NAMES]
        wrong += not state == rows[push] == frames[push]["observation.state"]
        errors.append(np.abs(shown[frames[push]["index"]] - seen[push].astype(float)).mean())
    return wrong, float(np.mean(errors))


def doctor(folder: Path) -> int | None:
    """Return how many faults `lerobot-doctor` finds; None: it is not there."""
    program = shutil.which("lerobot-doctor")
    if program is None:
        return None
    ended = subprocess.run([program, "check", folder], check=False, capture_output=True, text=True)
    if "Summary:" not in ended.stdout:
        raise SystemExit(f"lerobot-doctor said nothing of {folder}: {ended.stderr}")
    faults = re.findall(r"^\[FAIL\].*(?:\n  .*)*", ended.stdout, re.MULTILINE)
    print(*faults, sep="\n", flush=True)
    return len(faults)


class Harness:
    """Tries each step as often as it is wanted, and keeps what became of it."""

    def __init__(self, options: Options, place: Path) -> None:
        """Make the bag, and the results without a kill."""
        self._options, self._try = options, place / "try"
        self.bag, self._wanted = place / "bag", dict[str, dict[str, bytes]]()
        make_bag(self.bag, options.pushes)
        data = place / "data"
        Fork(partial(make_data, data)).end()
        self.calls: dict[str, tuple[Callable[[Path], object], str]] = {
            "npz": (partial(to_dataset, self.bag, "npz"), CARD_FILE),
            "lerobot": (partial(to_dataset, self.bag, "lerobot"), CARD_FILE),
            "train": (partial(train_network, data), "sain.npz"),
        }
        self._usual = {"recording": Fork(partial(record, place / "r", 0, place / "f")).end()[1]}
        for step, (call, _) in self.calls.items():
            succeeded, self._usual[step] = Fork(partial(call, self._try / "out")).end()
            if not succeeded:
                raise SystemExit(f"{step} fails without a kill")
            self._wanted[step] = contents(self._try / "out")
            self._try.rename(place / step)
            print(f"{step}: {self._usual[step]:.2f} s without a kill", flush=True)

    def run(self, step: str, number: int) -> str | None:
        """Try a step; return what was lost, "" for nothing, None: no process was killed."""
        random = np.random.default_rng((self._options.seed, STEPS.index(step), number))
        folder = self._try  # always the same: some files name their folder
        folder.mkdir()
        try:
            if step == "recording":
                return try_recording(folder, self._usual[step], random)
            if step == "damage":
                return try_damage(self.bag, self._wanted["npz"], folder, random)
            call, last = self.calls[step]
            return try_call(call, self._wanted[step], last, folder, self._usual[step], random)
        finally:
            shutil.rmtree(folder)


def tried(path: Path) -> list[dict[str, Any]]:
    """Return the tries so far."""
    return list(map(json.loads, path.read_text().splitlines())) if path.exists() else []


def main() -> None:
    """Run from the command line."""
    options = read_options(Options, __doc__)
    options.kept.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        harness = Harness(options, Path(name))
        wrong, error = check_values(harness.bag, Path(name, "npz/out"), Path(name, "lerobot/out"))
        faults = doctor(Path(name, "lerobot/out"))
        done = tried(options.kept)
        for step in STEPS:
            number = sum(one["step"] == step for one in done)
            hit = sum(one["step"] == step and one["lost"] is not None for one in done)
            while hit < getattr(options, step):
                lost = harness.run(step, number)
                append_json(options.kept, {"step": step, "number": number, "lost": lost})
                if lost:
                    print(f"{step} {number}: {lost}", flush=True)
                number, hit = number + 1, hit + (lost is not None)
    figures = []
    for step in STEPS:
        found = [one["lost"] for one in tried(options.kept) if one["step"] == step]
        hits = [one for one in found if one is not None]
        figures += [
            Figure(f"{step}: kills or damages", len(hits), "tries"),
            Figure(f"{step}: tries that lost something", sum(map(bool, hits)), "tries", at_most=0),
        ]
    figures += [
        Figure("pushes of a data set that differ from the bag's", wrong, "pushes", at_most=0),
        Figure("mean error of a pixel of the video, of 255", error, ""),
    ]
    if faults is not None:
        figures.append(Figure("faults that lerobot-doctor finds", faults, "checks", at_most=0))
    report("Kills and damages from tick to policy", figures, options.out)


if __name__ == "__main__":
    main()
