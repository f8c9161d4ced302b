"""Collection on a real Ray cluster, which is made on this machine for the test.

Ray is not imported here: it reads the variables that make it private when it is imported.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from sain_core.scratch import scratch_folder
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig
from sain_sim.commands import collect as main

CONFIG = CollectConfig(episodes=4, seed=6, workers=2, ray="local", episode=EpisodeConfig(pushes=3))


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """A home and a folder for temporary files where everything that is written can be seen."""
    scratch_folder("own").cleanup()  # what this process keeps to its end is not to be there
    with tempfile.TemporaryDirectory(prefix="t-", dir="/tmp") as folder:  # sockets: short paths
        monkeypatch.setenv("HOME", str(tmp_path))
        monkeypatch.setattr(tempfile, "tempdir", folder)
        yield Path(folder)


def processes(word: str) -> list[int]:
    """The processes of this machine whose command line holds a word."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if word in path.read_text(errors="replace"):
                found.append(int(path.parent.name))
        except OSError:
            continue
    return found


def entries(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def shared_memory() -> set[str]:
    """What stands in shared memory, without what other tests may have there meanwhile."""
    others = ("fastrtps", "fastdds", "sem.fastrtps", "sem.fastdds", "sem.mp-")
    others += ("sem.loky-", "joblib_memmapping_folder_")
    return {name for name in entries(Path("/dev/shm")) if not name.startswith(others)}


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_a_cluster_writes_the_same_bytes_and_leaves_nothing(elsewhere, tmp_path):
    alone = replace(CONFIG, out=tmp_path / "alone", workers=1, ray="")
    collect(alone)
    shared, home = shared_memory(), entries(tmp_path)
    used = []

    def look(episodes: int, transitions: int) -> None:
        used.extend(processes(str(elsewhere)) if episodes else [])

    assert collect(replace(CONFIG, out=tmp_path / "cluster"), look).transitions > 4
    assert used  # Ray was here, and nowhere else
    assert content(tmp_path / "cluster") == content(alone.out)
    assert processes(str(elsewhere)) == [] and list(elsewhere.iterdir()) == []
    assert shared_memory() <= shared
    assert entries(tmp_path) == home | {"cluster"}


def test_without_ray_there_is_one_clear_line(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ray", None)
    assert main(["--out", str(tmp_path), "--episodes", "1", "--ray", "local"]) == 1
    error = capsys.readouterr().err
    assert "collect: --ray needs Ray, which is not installed: pip install" in error
    assert ".[ray]" in error  # brackets are no markup
    assert "Traceback" not in error


@pytest.mark.parametrize("address", ["127.0.0.1:9", "nowhere", "127.0.0.1:many"])
def test_an_address_without_a_cluster_is_refused_at_once(tmp_path, address, capsys):
    assert main(["--out", str(tmp_path), "--episodes", "1", "--ray", address]) == 1
    assert f"collect: no Ray cluster at '{address}'" in capsys.readouterr().err
