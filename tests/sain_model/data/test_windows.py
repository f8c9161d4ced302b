from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.push import LENGTH
from sain_core.scene import X
from sain_model.data.dataset import Dataset, load_dataset, split_by_episode
from sain_model.data.windows import make_windows
from tests.sain_model.rolling import EPISODES, EVERY, PUSHES, load_episodes


def test_windows_never_cross_episodes_and_lose_no_push(tmp_path: Path) -> None:
    shuffled = load_episodes(tmp_path, np.random.default_rng(0).permutation(EVERY))
    windows = make_windows(shuffled, 4)
    assert sorted(windows.rows[:, 0]) == list(range(len(EVERY)))
    for rows, episode, known in zip(windows.rows, windows.episodes, windows.known, strict=True):
        used = rows[known]
        assert (shuffled.episode[used] == episode).all()
        first = shuffled.step[rows[0]]
        length = min(4, PUSHES - first)
        np.testing.assert_array_equal(shuffled.step[used], np.arange(first, first + length))


def test_a_window_is_what_happened(tmp_path: Path) -> None:
    data = load_episodes(tmp_path)
    windows = make_windows(data, 3, whole=True)
    assert len(windows) == EPISODES * (PUSHES - 2) and windows.known.all()
    np.testing.assert_array_equal(windows.scenes, data.state[windows.rows[:, 0]])
    np.testing.assert_array_equal(windows.next_scenes, data.next_state[windows.rows])
    np.testing.assert_array_equal(windows.pushes, data.action[windows.rows])
    later = data.state[windows.rows[:, 1:]]
    np.testing.assert_array_equal(windows.next_scenes[:, :-1], later)


def test_behind_a_windows_end_nothing_moves(tmp_path: Path) -> None:
    windows = make_windows(load_episodes(tmp_path), PUSHES)
    last = windows.select(windows.known.sum(axis=1) == 1)
    assert len(last) == EPISODES
    assert (last.pushes[:, 1:, LENGTH] == 0.0).all()
    assert (last.next_scenes[:, 1:] == last.next_scenes[:, :1]).all()


def test_no_window_spans_a_gap(tmp_path: Path) -> None:
    """Neither where a step is missing, nor where a scene is another than the push before left."""
    data = load_episodes(tmp_path / "gap", np.delete(EVERY, 2))
    windows = make_windows(data, PUSHES)
    assert windows.known[0].sum() == 2  # pushes 0 and 1 of episode 0; 3 to 5 stand by themselves
    assert windows.known[2].sum() == 3
    whole = load_episodes(tmp_path / "whole")
    scenes = whole.state.copy()
    scenes[3, 0, X] += 1e-6
    touched = make_windows(replace(whole, state=scenes), PUSHES)
    assert touched.known[0].sum() == 3


def test_no_window_of_a_training_episode_is_in_validation_or_test(tmp_path: Path) -> None:
    split = split_by_episode(Dataset((load_episodes(tmp_path),)), 0, 0.2, 0.2)
    parts = [part.alike for part in (split.train, split.validation, split.test)]
    seen = [set(make_windows(part, 4).episodes.tolist()) for part in parts]
    assert sum(map(len, seen)) == EPISODES == len(set.union(*seen))


def test_what_has_no_long_windows_says_so(dataset: Path) -> None:
    data = load_dataset(dataset).alike  # its pushes do not follow each other
    assert make_windows(data, 3).known.sum() == len(data)
    with pytest.raises(DatasetError, match="no episode has 3 successive pushes"):
        make_windows(data, 3, whole=True)
