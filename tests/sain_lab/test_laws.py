"""Laws of a learner, whatever happens in which order: it is killed, restarted, and trains."""

import os
import shutil

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import sain_lab.learner
from sain_core.output import write_whole
from sain_lab.learner import Learner
from sain_lab.physics import Believer
from sain_lab.storage.laboratory import LOG, Laboratory
from sain_lab.storage.log import FAILED, TRAINED, TRAINING, encoded
from sain_model.dynamics.load import card_path, shipped_checkpoint
from tests.sain_lab.table import SmallTable

OPERATIONS = st.one_of(
    st.sampled_from(["receive", "receive", "learn", "learn", "poll", "finish", "end", "close"]),
    st.tuples(st.just("kill"), st.integers(0, 40)),
    st.tuples(st.just("kill while it learns"), st.integers(0, 3), st.booleans()),
)
TABLE = SmallTable()
RESULTS = [TABLE.push() for _ in range(12)]


class Killed(BaseException):
    """The process is no more."""


class Training:
    """A training that ends on `finish`; its network is the shipped one."""

    def __init__(self, path):
        self.path, self.running, self.problem = path, True, ""

    @classmethod
    def start(cls, laboratory, pushes):
        return cls(laboratory.model_path(f"models/{pushes:06d}"))

    def finish(self):
        for suffix in (".safetensors", ".json"):
            content = shipped_checkpoint().with_suffix(suffix).read_bytes()
            write_whole(self.path.with_suffix(suffix), content)
        self.running = False

    wait = finish

    def stop(self):
        self.running = False


class LearnerRun:
    """A laboratory, and what happens to it."""

    def __init__(self, path):
        self.path, self.received = path, 0
        self.learner = Learner.named(str(path))

    def do(self, what, *about):
        learner = self.learner
        match what:
            case "receive" if self.received < len(RESULTS):
                learner.receive(RESULTS[self.received])
                self.received += 1
            case "learn" if learner.waiting:
                learner.observe(learner.waiting[0])
            case "poll":
                learner.poll()
            case "finish" if learner._training:
                learner._training.finish()
            case "end":
                learner.end_episode()
            case "close":
                learner.close()
                self.learner = Learner.named(str(self.path))
            case "kill":
                self.kill(*about)
            case "kill while it learns" if learner.waiting:
                self.kill_at(*about)

    def kill(self, written=0):
        """End the process, with so many bytes of the next record written."""
        laboratory = self.learner.laboratory
        if written:
            os.pwrite(
                laboratory._log._file, encoded({"kind": "end"})[:written][:-1], laboratory._log.size
            )
        for file in (laboratory._lock, laboratory._log._file, laboratory._waiting._file):
            os.close(file)
        self.learner = Learner.named(str(self.path))

    def kill_at(self, count, before):
        """End the process before or after it has written the record of this number."""
        laboratory, left = self.learner.laboratory, [count]
        append = laboratory.append

        def die(record):
            if not before:
                append(record)
            left[0] -= 1
            if left[0] < 0:
                raise Killed
            if before:
                append(record)

        laboratory.append = die
        try:
            self.learner.observe(self.learner.waiting[0])
        except Killed:
            self.kill()
        else:
            del laboratory.append

    def end(self):
        """Learn all that waits."""
        while self.learner.waiting:
            self.learner.observe(self.learner.waiting[0])
        self.learner.wait()
        self.learner.close()


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(sain_lab.learner, "Training", Training)
    patch.setattr(sain_lab.learner, "FIRST_TRAINING", 3)
    patch.setattr(Believer, "update", lambda self: False)  # a fit takes time
    yield tmp_path_factory.mktemp("laws")
    patch.undo()


@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(OPERATIONS, min_size=8, max_size=30))
@example(["receive"] * 6 + ["learn"] * 3 + ["poll", "finish"] + ["learn"] * 3)
@example(["receive"] * 6 + ["learn"] * 3 + ["finish", ("kill", 0)] + ["learn"] * 3)
@example(["receive"] * 6 + ["learn"] * 2 + [("kill while it learns", 0, False), "learn"])
@example(["receive"] * 12 + ["learn"] * 5 + ["close"])
def test_each_push_is_learned_once_and_each_network_judged(place, operations):
    shutil.rmtree(place, ignore_errors=True)
    (place / "lab" / "models" / "mine").mkdir(parents=True)
    (place / "elsewhere").mkdir()
    (place / "lab" / "models" / "mine" / "weights").write_text("mine")
    shutil.move(place / "lab" / "models", place / "models")
    run = LearnerRun(place / "lab")
    shutil.move(place / "models", place / "lab" / "models")
    for one in operations:
        run.do(*([one] if isinstance(one, str) else one))
    run.end()
    used = {run.learner.state.judge.service, run.learner.state.judge.candidate}
    networks = {f"models/{one.name}" for one in (place / "lab" / "models").iterdir()}
    assert networks - {"models/mine"} <= used
    laboratory = Laboratory(place / "lab")
    records = list(laboratory.records())
    learned = [one["digest"] for one in records if one["kind"] == "push"]
    assert learned == [one.digest for one in RESULTS[: run.received]]
    check_trainings([one for one in records if one["kind"] == "event"], records)
    assert laboratory.damage == [] and list(laboratory.waiting()) == []
    assert (place / "lab" / "models" / "mine" / "weights").read_text() == "mine"
    assert sorted(one.name for one in place.iterdir()) == ["elsewhere", "lab"]


def check_trainings(events, records):
    """Check that each training ends, and that its network is judged on all pushes since."""
    ends = [one for one in events if one["event"] in (TRAINING, TRAINED, FAILED)]
    assert [one["event"] for one in ends] == [TRAINING, TRAINED] * (len(ends) // 2)
    for begun, ended in zip(ends[::2], ends[1::2], strict=True):
        assert ended["about"]["model"] == begun["about"]["model"]
        unseen = ended["about"]["unseen"]
        assert len(unseen) == ended["pushes"] - begun["pushes"] and None not in unseen
        after = records[records.index(ended) + 1 :]
        pushes = [one for one in after if one["kind"] == "push"][:1]
        replaced = any(one.get("event") in (TRAINED, "loaded") for one in after)
        assert replaced or all(ended["about"]["model"] in one["errors"] for one in pushes)


def test_what_fails_in_a_prediction_is_said_and_a_lost_network_left_out(place, tmp_path):
    run = LearnerRun(tmp_path / "lab")
    for what in ["receive"] * 6 + ["learn"] * 3 + ["finish", "poll"]:
        run.do(what)
    assert run.learner.state.judge.candidate == "models/000003"
    run.learner._contenders.forget("models/000003")
    card_path(run.learner.laboratory.model_path("models/000003")).unlink()
    events = run.learner.observe(run.learner.waiting[0]).events
    assert events[0].kind == "left out"
    assert "models/000003 did not predict a push: " in events[0].text
    assert "sain.json does not exist" in events[0].text
    run.end()
    assert (tmp_path / "lab" / LOG).exists()
