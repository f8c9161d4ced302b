"""Who lets the arm move: false counts at once, and holds."""

from hypothesis import given
from hypothesis import strategies as st

from sain_arm.ros.enabling import HOLD, LONGEST_HOLD, Enabled, EnableGate, Signal

TIMEOUT = 0.3


def fed(*signals: tuple[float, bool], publishers: int = 1) -> EnableGate:
    gate = EnableGate(TIMEOUT)
    for time, enabled in signals:
        gate.update(Signal(enabled, time, publishers))
    return gate


def beats(first: float, last: float, enabled: bool = True, every: float = 0.1) -> list:
    count = round((last - first) / every)
    return [(first + every * number, enabled) for number in range(count + 1)]


def test_a_heartbeat_enables_after_a_while_until_it_stops():
    assert fed().state(0.0) is Enabled.SILENT
    gate = fed(*beats(5.0, 5.2))
    assert gate.state(5.2) is Enabled.WAITING
    gate = fed(*beats(5.0, 6.0))
    assert gate.state(6.0) is gate.state(6.3) is Enabled.YES
    assert gate.state(6.31) is Enabled.SILENT
    gate.update(Signal(True, 7.0))  # one after a pause is not enough
    assert gate.state(7.0) is Enabled.WAITING


def test_false_counts_at_once_and_until_only_true_came_for_a_while():
    gate = fed(*beats(5.0, 6.0), (6.01, False))
    assert gate.state(6.01) is Enabled.DENIED
    for time, enabled in beats(6.05, 7.0):
        gate.update(Signal(enabled, time))
        assert (gate.state(time) is Enabled.YES) == (time >= 6.05 + HOLD)
    assert not gate.is_disputed(7.0)  # there is one publisher


def test_two_that_disagree_never_enable_however_slow_the_one_is():
    """As `ros2 topic pub` does, with 1 Hz, beside a heartbeat."""
    for every in (0.05, 0.1, 0.35, 1.0, 1.9):
        signals = sorted(beats(5.0, 25.0) + beats(5.55, 25.0, False, every))
        gate = EnableGate(TIMEOUT)
        for time, enabled in signals:
            gate.update(Signal(enabled, time, publishers=2))
            if time > 5.6:
                assert gate.state(time) is not Enabled.YES, (every, time)
                assert gate.is_disputed(time)
        for time, enabled in beats(25.05, 29.0):  # the one that says false is stopped
            gate.update(Signal(enabled, time))
        assert gate.state(29.0) is Enabled.YES


SIGNALS = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.sampled_from([True, True, True, False]), st.integers(1, 3)),
    max_size=60,
)


@given(SIGNALS)
def test_whatever_comes_enabled_means_only_true_for_long_enough_and_until_now(signals):
    gate, now, came = EnableGate(TIMEOUT), 0.0, list[tuple[float, bool]]()
    for pause, enabled, publishers in signals:
        now += pause
        gate.update(Signal(enabled, now, publishers))
        came.append((now, enabled))
        for later in (0.0, 0.1, 0.29, 0.31, LONGEST_HOLD):
            if gate.state(now + later) is Enabled.YES:
                assert later <= TIMEOUT + 1e-9
                recent = [one for time, one in came if time >= now + later - HOLD]
                assert all(recent)
                assert now + later - came[0][0] >= HOLD - 1e-9
