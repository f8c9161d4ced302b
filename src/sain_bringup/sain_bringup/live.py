"""``ros2 run sain_bringup live``: the whole graph with its live page, until Ctrl-C."""

from rich.console import Console

from sain_bringup.graph_options import LiveOptions
from sain_bringup.running import run as run_graph
from sain_live.settings import check_free


def run(options: LiveOptions, console: Console) -> int:
    """Run graph and page until they are interrupted; return the exit code.

    Raises:
        BusyError: the port is in use; nothing was started.
        SainError: a package is not installed, or a log cannot be written.
    """
    check_free(options.host, options.port)
    return run_graph(options, console)
