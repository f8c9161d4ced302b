import dataclasses
import json
import logging
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress

import numpy as np
import pytest

import sain_sim.collecting.collect as collection
import sain_sim.collecting.shards
from sain_core.errors import ConfigError, DatasetError, OutputError
from sain_core.output import MANIFEST
from sain_core.randomness import generator
from sain_core.scene import POSITION, TARGET, surface_gaps
from sain_core.transitions import COLLECTED, Column, shard_path
from sain_core.world import DivergedError
from sain_sim.collecting.collect import CollectConfig, account, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeRunner
from sain_sim.collecting.shards import JOURNAL_FILE, load_shards
from sain_sim.commands import collect as main
from sain_sim.world.engines import MUJOCO
from sain_sim.world.parameters import sample_parameters
from sain_sim.world.start import draw_start
from sain_sim.world.truth import TruthConfig
from sain_sim.world.workcell import WorldConfig

SHORT = EpisodeConfig(pushes=3, floor_episodes=1)


@pytest.fixture(scope="module")
def collected(tmp_path_factory):
    """Three short episodes in one go, in shards of four."""
    folder = tmp_path_factory.mktemp("collected")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collection, "SHARD_SIZE", 4)
        patch.setattr("sain_sim.collecting.shards.SHARD_SIZE", 4)
        config = CollectConfig(out=folder, episodes=3, seed=3, episode=SHORT)
        yield config, collect(config).transitions


def content(folder) -> dict[str, bytes]:
    return {
        path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.name != MANIFEST
    }


def test_every_column_is_as_the_schema_has_it(collected):
    config, total = collected
    data = load_shards(config.out)
    assert list(data) == list(COLLECTED)
    for column in COLLECTED:
        assert data[column].shape == (total, *column.row_shape(2)), column
        assert data[column].dtype == column.dtype, column


def test_transitions_are_what_they_say(collected):
    config, total = collected
    data = load_shards(config.out)
    assert len(data["state"]) == total > 5
    assert data["state"].shape == data["next_state"].shape == data["physics_next"].shape
    assert data["state"].shape[1:] == (16,) and data["action"].shape[1:] == (5,)
    assert all(np.isfinite(data[name]).all() for name in data if name != "floor_next")
    first = data["episode"] == 0
    assert np.isfinite(data["floor_next"][first]).all()
    assert np.isnan(data["floor_next"][~first]).all()
    follows = (np.diff(data["step"]) == 1) & (np.diff(data["episode"]) == 0)
    assert np.array_equal(data["state"][1:][follows], data["next_state"][:-1][follows])
    before, after = (
        data[n].reshape(-1, 2, 8)[:, TARGET, POSITION] for n in ("state", "next_state")
    )
    assert np.array_equal(data["moved"], np.linalg.norm(after - before, axis=-1) >= 0.002)
    assert data["moved"].any()
    card = json.loads((config.out / "card.json").read_text())
    assert card["transitions"] == total and card["seed"] == 3


def test_workers_and_a_kill_change_no_byte(collected, tmp_path):
    config, total = collected
    whole = content(config.out)
    two = dataclasses.replace(config, out=tmp_path / "two", workers=2)
    assert collect(two).transitions == total
    assert content(two.out) == whole

    class KilledError(Exception):
        pass

    def kill(episodes: int, transitions: int) -> None:
        if episodes == 2:
            raise KilledError

    cut = dataclasses.replace(config, out=tmp_path / "cut")
    with pytest.raises(KilledError):
        collect(cut, kill)
    assert shard_path(cut.out, 0).exists() and not (cut.out / "card.json").exists()
    (cut.out / ".shard-00001.npz.77.partial").write_bytes(b"half")
    mine = dict.fromkeys(("thesis.partial", ".mine.partial", ".probe"), b"the only copy")
    for name, text in mine.items():
        (cut.out / name).write_bytes(text)
    assert collect(cut).transitions == total
    assert content(cut.out) == whole | mine


@pytest.mark.parametrize("name", ["conversion.json", "shard-00000.npz", "card.json"])
def test_what_no_collection_made_is_left_alone(collected, tmp_path, name, capsys):
    (tmp_path / name).write_bytes(b"a conversion")
    assert main(["--out", str(tmp_path), "--episodes", "1"]) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert f"{name} exists, and no list of SAIN names it; --overwrite replaces it" in said
    assert content(tmp_path) == {name: b"a conversion"}


def test_another_collection_in_the_folder_is_left_alone(collected):
    config, _ = collected
    whole = content(config.out)
    with pytest.raises(DatasetError, match="was collected with seed = 3, not 4"):
        collect(dataclasses.replace(config, seed=4))
    assert content(config.out) == whole


def test_a_full_disk_keeps_what_is_whole_and_the_collection_goes_on(collected, tmp_path):
    config, total = collected
    full = dataclasses.replace(config, out=tmp_path)

    def no_space(path, arrays):
        raise OutputError(f"cannot write {path}: No space left on device")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sain_sim.collecting.shards.write_arrays", no_space)
        with pytest.raises(OutputError, match=r"shard-00000\.npz: No space left"):
            collect(full)
    with pytest.MonkeyPatch.context() as patch:
        write, path = sain_sim.collecting.shards.write_arrays, shard_path(tmp_path, 1)
        patch.setattr(
            "sain_sim.collecting.shards.write_arrays",
            lambda to, arrays: no_space(to, arrays) if to == path else write(to, arrays),
        )
        with pytest.raises(OutputError, match=r"shard-00001\.npz: No space left"):
            collect(full)
    first = shard_path(tmp_path, 0).read_bytes()
    assert first == shard_path(config.out, 0).read_bytes()
    assert collect(full).transitions == total
    assert content(tmp_path) == content(config.out)


@pytest.mark.parametrize("to_all", [True, False], ids=["terminal", "process"])
def test_ctrl_c_ends_a_collection_and_its_workers_quietly(tmp_path, to_all):
    """A terminal sends the signal to all processes of the group; `kill -INT` to one."""
    out = tmp_path / "out"

    def start(episodes):
        words = f"collect --workers 2 --pushes 2 --floor-episodes 0 --episodes {episodes} --out"
        code = "import sys; from sain_core.cli.program import main; sys.exit(main())"
        command = [sys.executable, "-c", code, *words.split(), str(out)]
        return subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)

    process = start(100_000)
    try:
        journal, give_up = out / JOURNAL_FILE, time.monotonic() + 120
        while not journal.exists() or journal.read_bytes().count(b"\n") < 3:
            assert process.poll() is None and time.monotonic() < give_up
            time.sleep(0.05)
        stopped = time.monotonic()
        (os.killpg if to_all else os.kill)(process.pid, signal.SIGINT)
        _, said = process.communicate(timeout=60)
        assert (process.returncode, time.monotonic() - stopped < 20) == (130, True)
        *progress, last = said.splitlines()
        assert last == "stopped; the same command continues from the last whole shard"
        assert all(" episodes, " in line for line in progress), said
        with pytest.raises(ProcessLookupError):
            for _ in range(100):  # workers look every 0.2 s whether their owner lives
                os.killpg(process.pid, 0)
                time.sleep(0.05)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert {path.name for path in out.iterdir()} == {"collection.json", JOURNAL_FILE, MANIFEST}
    again = start(2)
    assert again.wait(120) == 0, again.stderr.read()
    assert len(set(load_shards(out)["episode"])) == 2


def test_missing_and_damaged_shards_are_named(tmp_path):
    with pytest.raises(DatasetError, match="holds no shards"):
        load_shards(tmp_path)
    shard_path(tmp_path, 0).write_bytes(b"PK not a zip")
    with pytest.raises(DatasetError, match=r"shard-00000\.npz is not a whole \.npz"):
        load_shards(tmp_path)


def test_the_command_collects_more_disks_and_the_papers_grid(tmp_path, capsys):
    arguments = ["--out", str(tmp_path), "--episodes", "1", "--disks", "3", "--sampler", "grid"]
    assert main([*arguments, "--pushes", "2", "--moved-only"]) == 0
    capsys.readouterr()
    identity = json.loads((tmp_path / "collection.json").read_text())
    assert identity["disks"] == 3 and identity["sampler"] == "grid"
    assert main([*arguments, "--seed", "1"]) == 1
    assert "was collected with seed" in capsys.readouterr().err


def test_starts_have_room_and_half_of_the_targets_at_the_mid_disk():
    table = WorldConfig().feasibility.table
    gaps = []
    for seed in range(100):
        random = generator(seed, "start")
        scene = draw_start(random, sample_parameters(random, 4), table)
        assert surface_gaps(scene).min() >= 0.0
        gaps.append(surface_gaps(scene)[0, 1])
    assert 30 < (np.array(gaps) <= 0.002).sum() < 70
    with pytest.raises(ConfigError, match="no room for 5 disks"):
        random = generator(0, "start")
        draw_start(random, sample_parameters(random, 5), table, spread=0.1)


pytest.importorskip("mujoco", reason="MuJoCo is not installed")

EPISODE = EpisodeConfig(pushes=3, floor_episodes=1, truth=TruthConfig(engine=MUJOCO))


def test_a_push_that_diverges_ends_its_episode_and_is_not_recorded(monkeypatch, caplog):
    runner = EpisodeRunner(3, EPISODE)
    whole = runner.run(1)
    push, calls = runner._world.push, []

    def fail_at_the_second(*arguments):
        if len(calls) == 1:
            raise DivergedError("no solution")
        outcome = push(*arguments)
        calls.append(outcome)
        return outcome

    monkeypatch.setattr(runner._world, "push", fail_at_the_second)
    with caplog.at_level(logging.WARNING):
        cut = runner.run(1)
    assert len(whole.transitions) == 3 and len(cut.transitions) == 1
    assert np.array_equal(cut.transitions[0][Column.NEXT_STATE], whole.transitions[0]["next_state"])
    assert cut.counts.refused == 1 and cut.counts.stuck == 0
    assert "an episode ends after 1 pushes: no solution" in caplog.text
    runner.close()


def test_every_push_that_is_drawn_is_counted_once(tmp_path):
    config = CollectConfig(tmp_path / "all", 3, 5, episode=EpisodeConfig(pushes=4, sampler="grid"))
    done = collect(config)
    counts, data = done.counts, load_shards(config.out)
    assert counts.episodes == 3
    assert counts.valid == done.transitions == len(data["episode"])
    assert counts.moved == data["moved"].sum()
    ended = counts.edge + counts.toppled
    assert counts.drawn == ended + sum(
        (counts.unreachable, counts.blocked, counts.refused, counts.valid)
    )
    assert counts.blocked > 0 and counts.missed > 0
    card = json.loads((config.out / "card.json").read_text())
    assert card["tally"]["drawn"] == counts.drawn and card["pushes"] == 4
    assert f"{counts.blocked} blocked by another disk" in account(counts, config)[0]
