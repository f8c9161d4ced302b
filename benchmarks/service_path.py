"""From a settled scene on the wire to the push on the wire, on the whole graph.

    ./env python -m benchmarks.service_path

Plays `anywhere` episodes on the real processes, planning through the model's service, and reads
the recording: the time from the first message of a settled scene to the push that was planned
from it, both as the recorder received them. The planner's own time for the same plans stands
beside it.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from sain_bags.reader import Bag

EPISODES = 8
TARGET_P95 = 250.0  # [ms]


def measure(episodes: int = EPISODES) -> dict[str, np.ndarray]:
    """Play episodes; return latencies and planning times [ms], one for each push."""
    with tempfile.TemporaryDirectory(prefix="sain-bench-") as folder:
        out = Path(folder) / "run"
        command = ["ros2", "run", "sain_bringup", "closed_loop", "--scenario", "anywhere"]
        command += ["--episodes", str(episodes), "--no-video", "--out", str(out)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (out / "bag" / "metadata.yaml").is_file():
            sys.exit(f"the closed loop did not run:\n{done.stdout}\n{done.stderr}")
        return _read(Bag(out / "bag"))


def _read(bag: Bag) -> dict[str, np.ndarray]:
    settled: dict[tuple[int, int], int] = {}
    latencies, planning = [], []
    for received in bag.messages():
        message = received.message
        if received.type == "sain_interfaces/msg/Scene" and message.settled:
            settled.setdefault((message.episode_id, message.scene_id), received.log_time)
        elif received.type == "sain_interfaces/msg/Push":
            seen = settled.get((message.episode_id, message.scene_id))
            if seen is not None and message.scene_id > 1:  # the first waits for the goal
                latencies.append(1e-6 * (received.log_time - seen))
        elif received.type == "sain_interfaces/msg/Plan" and message.push_id:
            planning.append(1e3 * message.planning_time)
    return {"scene to push": np.array(latencies), "planner alone": np.array(planning)}


def main() -> None:
    """Measure and print."""
    table = Table(title="Service path, K = 1024, H = 6")
    for column in ("", "pushes", "p50, ms", "p95, ms", "target p95, ms"):
        table.add_column(column, justify="left" if not column else "right")
    for name, times in measure().items():
        p50, p95 = np.percentile(times, [50, 95])
        target = f"{TARGET_P95:.0f}" if name == "scene to push" else ""
        table.add_row(name, str(len(times)), f"{p50:.0f}", f"{p95:.0f}", target)
    Console().print(table)


if __name__ == "__main__":
    main()
