import json

import pytest

from sain_core.errors import BlockedError, OffTableError, OutputError, UnreachableError
from sain_sim.collecting.collect import CollectConfig, account, collect
from sain_sim.collecting.episode import EpisodeConfig
from sain_sim.collecting.shards import JOURNAL_FILE, CollectionJournal, PushCounts, load_shards


def test_every_push_that_is_drawn_is_counted_once(tmp_path) -> None:
    config = CollectConfig(tmp_path / "all", 3, 5, episode=EpisodeConfig(pushes=4, sampler="grid"))
    done = collect(config)
    counts, data = done.counts, load_shards(config.out)
    assert counts.episodes == 3
    assert counts.valid == done.transitions == len(data["episode"])
    assert counts.moved == data["moved"].sum()
    assert counts.drawn == sum(
        (counts.unreachable, counts.blocked, counts.refused, counts.edge, counts.valid)
    )
    assert counts.blocked > 0 and counts.missed > 0
    card = json.loads((config.out / "card.json").read_text())
    assert card["tally"]["drawn"] == counts.drawn and card["pushes"] == 4
    assert f"{counts.blocked} blocked by another disk" in account(counts, config)[0]


def test_the_filter_leaves_out_and_counts_what_did_not_move(tmp_path) -> None:
    episode = EpisodeConfig(pushes=4)
    every = collect(CollectConfig(tmp_path / "all", 3, 5, episode=episode))
    config = CollectConfig(
        tmp_path / "moved", 3, 5, episode=EpisodeConfig(pushes=4, moved_only=True)
    )
    moved = collect(config)
    assert moved.counts == every.counts
    assert 0 < moved.transitions == every.counts.moved < every.transitions
    kept, data = load_shards(config.out), load_shards(tmp_path / "all")
    for name, values in kept.items():
        assert (values == data[name][data["moved"]]).all() or name == "floor_next"
    assert f"left out: {every.counts.missed} that missed it" in account(moved.counts, config)[1]


def test_refusals_are_counted_by_their_reason() -> None:
    counts = PushCounts()
    for error in (UnreachableError(), BlockedError(), BlockedError(), OffTableError()):
        counts.refuse(error)
    assert (counts.unreachable, counts.blocked, counts.refused, counts.drawn) == (1, 2, 1, 4)


def test_a_journal_forgets_what_is_to_come_again_and_what_is_half_written(tmp_path) -> None:
    journal = CollectionJournal(tmp_path, 0)
    for episode in range(4):
        journal.add(episode, PushCounts(episodes=1, moved=episode + 1))
    whole = (tmp_path / JOURNAL_FILE).read_bytes()
    (tmp_path / JOURNAL_FILE).write_bytes(whole[:-20])
    resumed = CollectionJournal(tmp_path, 2)
    assert resumed.total == PushCounts(episodes=2, moved=3)
    for episode in (2, 3):
        resumed.add(episode, PushCounts(episodes=1, moved=episode + 1))
    assert (tmp_path / JOURNAL_FILE).read_bytes() == whole
    assert resumed.total == PushCounts(episodes=4, moved=10)


def test_a_journal_on_a_full_disk_says_so(tmp_path) -> None:
    journal = CollectionJournal(tmp_path, 0)
    (tmp_path / JOURNAL_FILE).unlink()
    (tmp_path / JOURNAL_FILE).symlink_to("/dev/full")
    with pytest.raises(OutputError, match="No space left on device"):
        journal.add(0, PushCounts())
