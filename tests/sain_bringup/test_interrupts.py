"""A signal ends the program wherever it comes."""

import os
import signal

import pytest

from sain_bringup.interrupts import SIGNALS, Interrupts, Stopped


@pytest.fixture
def interrupts():
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield Interrupts()
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize("number", SIGNALS)
def test_a_signal_is_raised_where_the_program_is(number, interrupts):
    interrupts.check()
    with pytest.raises(Stopped) as caught:
        os.kill(os.getpid(), number)
    assert caught.value.number == number
