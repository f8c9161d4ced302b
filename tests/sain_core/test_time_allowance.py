"""A small file does not take long."""

import time

import pytest

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import (
    TimeAllowance,
    decoding_seconds,
    most_messages,
    unpacked_bytes,
)


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
    assert decoding_seconds(1 << 20) == decoding_seconds(0) + 20.0
    assert unpacked_bytes(1000) - unpacked_bytes(0) == 200_000
    assert most_messages(80) - most_messages(0) == 10
