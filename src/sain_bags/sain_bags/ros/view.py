"""``ros2 run sain_bags view``: a bag in the live page, played by this process."""

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Final
from urllib.request import urlopen

from rich.console import Console

from sain_bags.cli.options import PlayOptions, ViewOptions
from sain_bags.playing import PassageConfig
from sain_bags.reading.reader import Bag
from sain_bags.ros.play import play_bag
from sain_bags.ros.stop_signal import StopSignal
from sain_core.cli.executables import executable
from sain_core.ros.node_main import ros_context

LOOK: Final = 0.1  # [s] between looks for the page
HEARD: Final = 2.0  # [s], for the page to find the topics
END: Final = 5.0  # [s], for the page to end


def run(options: ViewOptions, console: Console) -> int:
    """Serve the page and play the bag until a signal, the bag or the page comes to its end.

    Raises:
        DatasetError: the bag is damaged, or there is nothing in it that can be played.
        ConfigError: the live page is not installed.
    """
    Bag(options.bag).check()
    passage = PassageConfig(rate=options.rate, loop=options.loop)
    stop = StopSignal()  # before the page can end: no signal comes too early
    with ros_context(), page(options, stop) as process:
        if process.poll() is None and not stop.wait(0.0):
            play_bag(PlayOptions(bag=options.bag, wait=HEARD, passage=passage), console, stop)
        return process.poll() or 0


@contextmanager
def page(options: ViewOptions, stop: StopSignal) -> Iterator["subprocess.Popen[bytes]"]:
    """Run the live page, once it is served or has failed; its end interrupts this process.

    Another process may serve the same address: this one's page then ends a little later.
    """
    given = (f"host:={options.host}", f"port:={options.port}", "use_sim_time:=true")
    words = [word for one in given for word in ("-p", one)]
    command = [str(executable("sain_live", "page_node")), "--ros-args", *words]
    process = subprocess.Popen(command, start_new_session=True)
    while process.poll() is None and not _is_served(options) and not stop.wait(LOOK):
        pass
    over = Event()

    def watch() -> None:
        if process.wait() and not over.is_set():
            os.kill(os.getpid(), signal.SIGINT)

    try:
        if process.poll() is None:
            Thread(target=watch, daemon=True).start()
        yield process
    finally:
        over.set()
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(END)
        except subprocess.TimeoutExpired:
            process.kill()


def _is_served(options: ViewOptions) -> bool:
    host = "127.0.0.1" if options.host in ("", "0.0.0.0") else options.host
    try:
        with urlopen(f"http://{host}:{options.port}", timeout=HEARD):
            return True
    except OSError:
        return False
