"""A learner on a table whose parameters it does not know."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.errors import ErrorCode
from sain_core.model import load_dynamics
from sain_lab.judging.curves import curves_of
from sain_lab.learner import Learner
from sain_lab.storage.laboratory import LOG, MANIFEST, Laboratory
from sain_lab.storage.log import JUMPED, NOT_LEARNED, LogReader
from tests.sain_lab.table import TRUE, SmallTable

PUSHES = 36


@pytest.fixture(scope="module")
def taught(tmp_path_factory):
    """The folder of a laboratory that saw many pushes, those, and what the learner said."""
    path, table = tmp_path_factory.mktemp("labs") / "small", SmallTable()
    results = [table.push() for _ in range(PUSHES)]
    with Learner.named(str(path), trains=False) as learner:
        updates = [learner.observe(one) for one in results]
        learner.end_episode()
    return path, results, updates


def test_the_next_push_is_predicted_better_the_more_was_learned(taught):
    _, _, updates = taught
    late = updates[PUSHES // 2 :]
    mean = {name: np.mean([one.errors[name] for one in late]) for name in ("planar", "physics")}
    assert mean["physics"] < 0.5 * mean["planar"]
    assert [event.kind for one in updates for event in one.events] == []  # the table stays


def test_true_parameters_lie_within_what_is_believed(taught):
    path, _, _ = taught
    values = curves_of(Laboratory(path).records()).parameters
    for name in ("slope_x", "length_offset"):
        first, last = values[name][0], values[name][-1]
        assert abs(last[1] - getattr(TRUE, name)) < 4.0 * last[2], name
        assert last[2] < 0.7 * first[2], name


def test_the_model_has_a_name_everywhere(taught):
    path, results, _ = taught
    one = results[-1]
    with Learner.named(str(path), trains=False) as learner:
        own = learner.model.step(one.before[None], one.push[None])
        assert learner.model_name == f"lab:{path}"
    model = load_dynamics(f"lab:{path}")
    np.testing.assert_array_equal(model.step(one.before[None], one.push[None]), own)
    np.testing.assert_array_equal(
        load_dynamics(str(path)).step(one.before[None], one.push[None]), own
    )


def test_nothing_is_learned_twice_live_or_after_a_kill(taught, tmp_path):
    """Cut the log between records and inside of them: pushes that are given again fill it up."""
    path, results, _ = taught
    content = (path / LOG).read_bytes()
    manifest = (path / MANIFEST).read_text()
    log = LogReader(path / LOG)
    ends = [log.place for record in log.read() if record["kind"] == "push"]
    for size in (ends[0] - 1, ends[3], ends[5] + 7):
        copy = tmp_path / str(size)
        copy.mkdir()
        (copy / MANIFEST).write_text(
            manifest.replace(f'"log_bytes": {len(content)}', '"log_bytes": 0')
        )
        (copy / LOG).write_bytes(content[:size])
        kept = sum(end <= size for end in ends)
        with Learner.named(str(copy), trains=False) as learner:
            assert learner.state.pushes == kept
            learned = [learner.observe(one).learned for one in results[: kept + 2]]
        assert learned == [False] * kept + [True] * 2
        digests = [r["digest"] for r in Laboratory(copy).records() if r["kind"] == "push"]
        assert digests == [one.digest for one in results[: kept + 2]]


def test_a_push_is_predicted_before_it_is_learned_from(taught, tmp_path):
    """The errors of the first pushes do not depend on those that follow."""
    _, results, updates = taught
    with Learner.named(str(tmp_path / "again"), trains=False) as learner:
        again = [learner.observe(one) for one in results[:8]]
    assert [one.errors for one in again] == [one.errors for one in updates[:8]]


def moved(scene, body, column, value):
    other = scene.copy()
    other[body, column] += value
    return other


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda r: {"after": r.after * np.nan}, "NaN or Inf"),
        (lambda r: {"push": np.array([0, 0, 0, np.inf, 0.2])}, "finite"),
        (lambda r: {"before": moved(r.before, 1, 0, 0.01)}, "somebody moved it"),
        (lambda r: {"before": moved(r.before, 0, 2, 0.5)}, "somebody moved it"),
        (lambda r: {"code": ErrorCode.BLOCKED}, "refused: BLOCKED"),
        (lambda r: {"after": moved(r.after, 0, 3, 0.2)}, "not at rest"),
        (lambda r: {"after": moved(r.after, 1, 0, 3.0)}, "a body moved 3"),
        (lambda r: {"after": r.after[:1]}, "shape"),
        (lambda r: {"episode": 300 * "e"}, "episode has 300 characters; allowed: 256"),
    ],
)
def test_what_cannot_be_is_not_learned_from_and_said(tmp_path, change, reason):
    table = SmallTable()
    with Learner.named(str(tmp_path / "lab"), trains=False) as learner:
        learner.observe(table.push())
        result = table.push()
        update = learner.observe(replace(result, identity="bad", **change(result)))
        assert not update.learned
        assert reason in update.reason
        assert [event.kind for event in update.events] == [NOT_LEARNED]
        assert learner.state.pushes == 1
    events = curves_of(Laboratory(tmp_path / "lab").records()).events
    assert reason in events[-1].text


@pytest.mark.parametrize(
    "change", [{"friction": 2 * TRUE.friction}, {"length_offset": 0.006}, {"tool_friction": 0.1}]
)
def test_a_table_that_changes_is_noticed_and_the_error_returns(tmp_path, change):
    table, kinds, errors = SmallTable(pushes=5), [], []
    with Learner.named(str(tmp_path / "lab"), trains=False) as learner:
        for _ in range(60):
            learner.observe(table.push())
        table.world = replace(table.world, config=replace(TRUE, **change))
        for _ in range(40):
            update = learner.observe(table.push())
            kinds += [event.kind for event in update.events]
            errors.append(update.errors["physics"])
    assert kinds == [JUMPED]
    assert np.mean(errors[25:]) < 0.5 * np.mean(errors[:10])
