"""What the service costs a plan.

1. The same plans with the model in this process and behind its node, in turns: same K, H and
   rounds, same scenes; bit for bit the same plans. The shortest time of some for each scene, at
   the default settings and at K = 1024, H = 15.
2. The closed loop on the whole graph, recorder and all: from the settled scene to the push, as the
   recorder received them, at the default settings; the planner's own time for the same plans beside
   it. First pushes of episodes have a figure of their own, from the goal on: nothing was planned
   before. The arm moves in real time, which leaves the planner the time of a push.
"""

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

import numpy as np

from benchmarks.faults.running import own_domain
from benchmarks.report import Figure, ReportOptions, read_options, report
from benchmarks.timing import fastest
from sain_bags.reading.reader import Bag
from sain_core.model import RolloutModel, load_dynamics
from sain_core.randomness import generator
from sain_core.types import Pushes
from sain_eval.scenes.families import ScenarioScene
from sain_eval.scenes.scenarios import SCENARIOS
from sain_mppi.config import PlannerConfig
from sain_mppi.objective.problem import Problem
from sain_mppi.planner import Planner

PATIENCE_S = 120.0
MOST_MS = {"anywhere": 25.0, "push_t": 40.0, "rearrange_4": 80.0}  # p95 of the closed loops
TIMEOUT_S = 10.0
REAL_TIME = "/**/sim_node:\n  ros__parameters:\n    real_time_factor: 1.0\n"
LATENCY = "settled scene to push"
FIRST = "goal to first push"

Times = dict[str, np.ndarray]  # [ms]


@dataclass(frozen=True)
class Options(ReportOptions):
    """How much to measure."""

    episodes: int = 8
    """of the closed loop, disks and one T each; a third of them with four bodies"""
    scenes: int = 8
    """planned from with the model here and behind its node"""
    repeats: int = 8
    """plans from each scene, of which the fastest counts"""
    model: str = "sain"
    """name or checkpoint"""
    only: tuple[str, ...] = ("service", "loops")
    """parts to measure"""


def service_and_process(options: Options) -> list[Figure]:
    """Plan with the model here and behind its node, in a domain of its own."""
    model = load_dynamics(options.model)
    figures = []
    with own_domain(), served(options.model) as remote:
        for config in (PlannerConfig(), PlannerConfig(samples=1024, horizon=15)):
            figures += compare_all(config, model, remote, options)
    return figures


def compare_all(
    config: PlannerConfig, model: RolloutModel, remote: RolloutModel, options: Options
) -> list[Figure]:
    """Plan from every scene with these settings, here and by the service."""
    cases = [SCENARIOS["anywhere"].scene(seed) for seed in range(options.scenes)]
    here, there = Planner(model, config), Planner(remote, config)
    pairs = [compare(case, here, there, options.repeats) for case in cases]
    process, service = np.sum(pairs, axis=0) / len(pairs)
    sizes = f"K = {config.samples}, H = {config.horizon}"
    return [
        Figure(f"a plan, {sizes}, model in process", 1e3 * process, "ms"),
        Figure("... behind its node", 1e3 * service, "ms"),
        Figure("... service / in process", service / process, "", at_most=1.15),
    ]


def compare(
    case: ScenarioScene, here: Planner, there: Planner, repeats: int
) -> tuple[float, float]:
    """Return the shortest times [s] of the same plan in process and by the service."""

    def plan(planner: Planner) -> Pushes:
        problem = Problem.of(case.disks, case.goal)
        return planner.plan(problem, generator(case.seed, "service")).pushes

    if plan(here).tobytes() != plan(there).tobytes():
        sys.exit("the two plans differ")
    times = fastest({"here": lambda: plan(here), "there": lambda: plan(there)}, repeats)
    return times["here"].wall, times["there"].wall


@contextmanager
def served(model: str) -> Iterator[RolloutModel]:
    """Start the model's node, and yield what asks it, as the planner's node does."""
    from rclpy.executors import SingleThreadedExecutor

    from sain_core.ros.node_main import command_node
    from sain_mppi.agent.planning import Patience
    from sain_mppi.ros.remote import RemoteRollout

    command = ["ros2", "run", "sain_model", "model_node", "--ros-args", "-p", f"model:={model}"]
    server = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        with command_node("asker") as node:
            executor = SingleThreadedExecutor()
            executor.add_node(node)
            remote = RemoteRollout(node, TIMEOUT_S, Patience())
            if not remote.wait_until_ready(PATIENCE_S):
                sys.exit("no model node")
            Thread(target=executor.spin, daemon=True).start()
            yield remote
            executor.shutdown()
    finally:
        server.terminate()
        server.wait()


def played(scenario: str, episodes: int) -> Times:
    """Play episodes on the whole graph; return latencies and planning times from the bag."""
    with tempfile.TemporaryDirectory(prefix="sain-bench-") as folder:
        out = Path(folder) / "run"
        command = ["ros2", "run", "sain_bringup", "closed_loop", "--scenario", scenario]
        command += ["--episodes", str(episodes), "--no-video", "--out", str(out)]
        settings = Path(folder) / "real_time.yaml"
        settings.write_text(REAL_TIME)
        command += ["--params-file", str(settings)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if not (out / "bag" / "metadata.yaml").is_file():
            sys.exit(f"the closed loop did not run:\n{done.stdout}\n{done.stderr}")
        return read(Bag(out / "bag"))


def closed_loop(scenario: str, episodes: int) -> list[Figure]:
    """Return figures of a closed loop."""
    figures = []
    for name, values in played(scenario, episodes).items():
        p50, p95 = np.percentile(values, [50, 95])
        at_most = MOST_MS[scenario] if name == LATENCY else None
        title = f"{scenario}: {name}, {len(values)} pushes, median"
        figures.append(Figure(title, float(p50), "ms"))
        figures.append(Figure("... 95th percentile", float(p95), "ms", at_most=at_most))
    return figures


def read(bag: Bag) -> Times:
    """Return latencies and planning times [ms], one for each push."""
    settled: dict[tuple[int, int], int] = {}
    begun: dict[int, tuple[int, int]] = {}  # the first scene of an episode, and when its goal came
    times: dict[str, list[float]] = {LATENCY: [], FIRST: [], "the search alone": []}
    for received in bag.messages():
        message, now = received.message, received.log_time
        if received.type == "sain_interfaces/msg/Scene" and message.settled:
            settled.setdefault((message.episode_id, message.scene_id), now)
        elif received.type == "sain_interfaces/msg/Goal":
            first = min(scene for episode, scene in settled if episode == message.episode_id)
            begun[message.episode_id] = first, now
        elif received.type == "sain_interfaces/msg/Push":
            first, aimed = begun.get(message.episode_id, (0, 0))
            if message.scene_id == first:
                times[FIRST].append(1e-6 * (now - aimed))
            elif (key := (message.episode_id, message.scene_id)) in settled:
                times[LATENCY].append(1e-6 * (now - settled[key]))
        elif received.type == "sain_interfaces/msg/Plan" and message.push_id:
            times["the search alone"].append(1e3 * message.search_time)
    return {name: np.array(values) for name, values in times.items()}


def main() -> None:
    """Measure what the service costs a plan."""
    options = read_options(Options, __doc__)
    figures = service_and_process(options) if "service" in options.only else []
    for scenario in MOST_MS if "loops" in options.only else ():
        few = scenario == "rearrange_4"  # these take many pushes
        episodes = -(-options.episodes // 3) if few else options.episodes
        figures += closed_loop(scenario, episodes)
    report("Service path, default settings", figures, options.out)


if __name__ == "__main__":
    main()
