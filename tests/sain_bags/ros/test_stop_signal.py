"""Signals, however fast they come, end a wait and hang nothing."""

import subprocess
import sys

FLOOD = """
import os, signal, threading
from sain_bags.ros.stop_signal import StopSignal
stop = StopSignal()
assert not stop.wait(0.01) and not stop.wait(0.0)
def flood():
    for count in range(20_000):
        os.kill(os.getpid(), (signal.SIGINT, signal.SIGTERM)[count % 2])
thread = threading.Thread(target=flood)
thread.start()
while thread.is_alive():
    stop.wait(0.001)
assert stop.wait(60.0) and stop.wait(0.0)
"""


def test_a_flood_of_signals_ends_a_wait_and_hangs_nothing():
    subprocess.run([sys.executable, "-c", FLOOD], check=True, timeout=50)
