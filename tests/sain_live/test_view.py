"""A bag in the live page: one command serves it, and a reader goes through it."""

import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from sain_bags.reading.reader import Bag
from sain_bags.report.content import read_content
from sain_bags.rows.episodes import read_episodes
from sain_core.cli.command_line import executable
from sain_core.scene import POSITION
from tests.sain_live.straw import free_port
from tests.sain_live.viewer import Viewer

pytestmark = pytest.mark.system


def start(*arguments: str) -> "subprocess.Popen[str]":
    command = [str(executable("sain_bags", "view")), *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


@contextmanager
def viewed(bag: Path, *arguments: str) -> Iterator[int]:
    """Run the command; yield the port that it says, and end it by Ctrl-C."""
    process = start(str(bag), "--port", str(port := free_port()), *arguments)
    said = ""
    while f"the page is at http://127.0.0.1:{port}" not in said:
        said = process.stdout.readline()
        assert said, process.wait()
    try:
        yield port
    finally:
        process.send_signal(signal.SIGINT)
        rest = process.communicate(timeout=30)[0]
    assert process.returncode in (0, 130) and "Traceback" not in rest


def facts(viewer: Viewer) -> dict[str, str]:
    """Return the rows of the page: values by their names."""
    rows = re.findall(r"<span[^>]*>([^<]*)</span><span[^>]*>([^<]*)</span>", viewer.texts)
    return dict(rows)


def test_a_reader_goes_through_a_recording(ros_domain, episode_bag):
    first, second = read_content(Bag(episode_bag)).data["episodes"]
    done = [push for push in first["pushes"] if push["outcome"] == "executed"]
    with viewed(episode_bag, "--rate", "0.01") as port:
        viewer = Viewer(port)

        def wait(name: str, value: str) -> None:
            viewer.wait(lambda: facts(viewer).get(name) == value, f"{name}: {value}", 60.0)

        viewer.wait(lambda: "distance left" in viewer.texts, "the page", 60.0)
        labels = {one.get("label") for one in viewer.controls.values()}
        assert not {"Start", "Reset", "Next seed", "Load file", "scenario"} & labels
        viewer.turn("push", len(done))
        wait("pushes", f"{len(done)} of {len(done)}")
        wait("distance left", f"{1e3 * done[-1]['distance'][1]:.1f} mm")
        last = read_episodes(Bag(episode_bag))[0].executed[-1]
        place = pytest.approx(tuple(last.after[1, POSITION]), abs=1e-5)
        viewer.wait(lambda: viewer.nodes["/bodies/1"]["position"][:2] == place, "the target")
        goal = viewer.nodes["/goals/1"]["position"][:2]
        assert goal == pytest.approx((first["poses"][0]["x"], first["poses"][0]["y"]), abs=1e-5)
        viewer.turn("steps", "◀ push")
        wait("pushes", f"1 of {len(done)}")
        for _ in range(2):
            viewer.turn("steps", "push ▶")
        viewer.wait(lambda: second["title"] in viewer.texts, "the next episode")
        viewer.turn("Play", True)
        viewer.wait(
            lambda: any(one.get("label") == "Pause" for one in list(viewer.controls.values())),
            "that it plays",
        )
        viewer.close()


def test_what_is_no_recording_ends_it_in_words(ros_domain, tmp_path):
    process = start(str(tmp_path / "missing"))
    said = process.communicate(timeout=60)[0]
    assert process.returncode == 1 and "missing" in said and "Traceback" not in said
