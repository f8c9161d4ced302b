"""A small file does not take long."""

import time

import pytest

from sain_core.errors import UntrustedFileError
from sain_core.untrusted import limits
from sain_core.untrusted.time_allowance import TimeAllowance


def test_time_is_added_up(monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter([0.0, 2.0, 10.0, 10.5, 20.0, 21.0])
    monkeypatch.setattr(time, "thread_time", lambda: next(now))
    allowance = TimeAllowance(0)  # 3 s
    for _ in range(2):
        with allowance:
            pass
    with pytest.raises(UntrustedFileError, match="more than 3 s"), allowance:
        pass


def test_larger_files_may_take_longer() -> None:
    assert limits.decoding_seconds(1 << 20) == limits.decoding_seconds(0) + 20.0
    assert limits.unpacked_bytes(1000) - limits.unpacked_bytes(0) == 200_000
    assert limits.most_messages(80) - limits.most_messages(0) == 10
