"""How fast data is collected, and how near to bare stepping: ``python -m benchmarks.collection``.

Collects with the real arm in truth and nominal shadow, on several processes, with both truths.
Beside it the *same motion* is stepped by PyBullet alone: everything that the worlds of some of
these episodes were told is written down and played back into worlds of their own, to the same
bytes, with nothing on the clock but ``stepSimulation`` and the commands between two steps (joints,
the tool's spring, friction of patches). Building worlds, drawing, planning, looking, deciding,
refusing and writing are the collection's work, and none of bare stepping's. A first episode is left
out of both, as everything is started with it.

The share is of CPU time, the least of some rounds, so that others on the machine hardly change it;
the rate is by the wall, and by CPU time as if each worker had a core of its own.
"""

import resource
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import tyro

from benchmarks.report import Figure, report
from sain_sim.arm.client import Client
from sain_sim.collecting.collect import CollectConfig, collect
from sain_sim.collecting.episode import EpisodeConfig, EpisodeRunner
from sain_sim.world.effects import ROUGH
from sain_sim.world.truth import RANDOMISED, TruthConfig

RESET, STEP = "resetSimulation", "stepSimulation"
QUESTIONS = ("get", "calculate", "connect", "disconnect")


@dataclass(frozen=True)
class Options:
    """How much to measure."""

    episodes: int = 120
    """episodes to collect in each world"""
    played: int = 6
    """of them, episodes whose motion is played back"""
    rounds: int = 5
    """how often these are collected and played back, in turn; the fastest of each counts"""
    workers: int = 2
    """processes that collect"""
    seed: int = 0
    """of the collection"""
    out: Path | None = None
    """write the figures to this JSON file"""


@dataclass
class Call:
    """Something that a client was told."""

    name: str
    arguments: tuple[Any, ...]
    settings: dict[str, Any]

    def on(self, client: Client) -> tuple[Any, tuple[Any, ...], dict[str, Any]]:
        """Return what to call, and with what, to tell another client the same."""
        return getattr(client, self.name), self.arguments, self.settings


@dataclass
class Tape:
    """All that a client was told, and how much of it before the clock starts."""

    calls: list[Call] = field(default_factory=list)
    warm: int = 0

    def cells(self) -> Iterator[list[Call]]:
        """Yield the calls world by world; each begins with a reset."""
        starts = [i for i, call in enumerate(self.calls) if call.name == RESET]
        for start, end in zip(starts, [*starts[1:], len(self.calls)], strict=True):
            yield self.calls[start:end]

    def play(self, client: Client) -> float:
        """Tell a client the same; return the CPU time [s] from first to last steps."""
        spent, told = 0.0, 0
        for calls in self.cells():
            timed, told = told >= self.warm, told + len(calls)
            steps = [i for i, call in enumerate(calls) if call.name == STEP]
            first, last = (steps[0], steps[-1] + 1) if steps else (len(calls), len(calls))
            for call in calls[:first]:
                getattr(client, call.name)(*call.arguments, **call.settings)
            motion = [call.on(client) for call in calls[first:last]]
            begun = time.process_time()
            for function, arguments, settings in motion:
                function(*arguments, **settings)
            spent += (time.process_time() - begun) if timed else 0.0
            for call in calls[last:]:
                getattr(client, call.name)(*call.arguments, **call.settings)
        return spent


TAPES: list[tuple[Client, Tape]] = []


class RecordedClient(Client):
    """A client that keeps a tape of what it is told."""

    def __init__(self, gui: bool = False) -> None:
        super().__init__(gui)
        self.tape = Tape()
        TAPES.append((self, self.tape))

    def __getattr__(self, name: str) -> Any:
        value = super().__getattr__(name)
        if not callable(value) or name.startswith(QUESTIONS):
            return value

        def call(*arguments: Any, **settings: Any) -> Any:
            self.tape.calls.append(Call(name, arguments, settings))
            return value(*arguments, **settings)

        self.__dict__[name] = call
        return call


def least_times(settings: tuple[int, EpisodeConfig], options: Options) -> tuple[float, float]:
    """Return the least CPU times [s] of bare stepping and of collecting the same episodes."""
    TAPES.clear()
    with mock.patch("sain_sim.world.world.Client", RecordedClient):
        runner = EpisodeRunner(*settings)
    with closing(runner):
        runner.run(0)
        for _, tape in TAPES:
            tape.warm = len(tape.calls)
        for episode in range(1, options.played + 1):
            runner.run(episode)
        rounds = [
            (bare_time(), collection_time(settings, options.played)) for _ in range(options.rounds)
        ]
    bare, collected = (min(times) for times in zip(*rounds, strict=True))
    return bare, collected


def bare_time() -> float:
    """Return the CPU time [s] that bare stepping of what is recorded takes."""
    spent = 0.0
    for recorded, tape in TAPES:
        with closing(Client()) as client:
            spent += tape.play(client)
            if poses(client) != poses(recorded):
                raise RuntimeError("what was played back is not what was recorded")
    return spent


def poses(client: Client) -> list[Any]:
    """Return where all bodies are."""
    return [
        client.getBasePositionAndOrientation(client.getBodyUniqueId(i))
        for i in range(client.getNumBodies())
    ]


def collection_time(settings: tuple[int, EpisodeConfig], episodes: int) -> float:
    """Return the CPU time [s] in which one process collects some episodes, files and all.

    They come after a first one, with which everything is started once.
    """
    begun = 0.0

    def start(done: int, transitions: int) -> None:
        nonlocal begun
        if done == 1:
            begun = time.process_time()

    with tempfile.TemporaryDirectory() as folder:
        config = CollectConfig(
            Path(folder) / "data", 1 + episodes, settings[0], episode=settings[1]
        )
        collect(config, start)
        return time.process_time() - begun


def rates(settings: tuple[int, EpisodeConfig], episodes: int, workers: int) -> tuple[float, float]:
    """Return valid transitions a minute: by the wall, and if each worker had a core of its own.

    The start of the workers is included in both.
    """
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "data"
        config = CollectConfig(out, episodes, *settings, workers=workers)
        begun, spent = time.perf_counter(), cpu_time()
        made = 60.0 * collect(config).transitions
        return made / (time.perf_counter() - begun), made * workers / (cpu_time() - spent)


def cpu_time() -> float:
    """Return the CPU time [s] of this process and of those it has started and that have ended."""
    usages = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)


def main() -> None:
    """Measure how fast data is collected, and how near to bare stepping that is."""
    options = tyro.cli(Options, description=main.__doc__)
    figures = []
    for truth in (RANDOMISED, ROUGH):
        settings = (options.seed, EpisodeConfig(truth=TruthConfig(truth)))
        bare, collected = least_times(settings, options)
        wall, alone = rates(settings, options.episodes, options.workers)
        name = f"{truth}, {options.workers} workers"
        figures.append(Figure(f"valid transitions, {name}", wall, "/min", at_least=1000.0))
        figures.append(Figure("... by their CPU time", alone, "/min", at_least=1000.0))
        share = 100.0 * bare / collected
        figures.append(Figure(f"of bare stepping, {truth}", share, "%", at_least=80.0))
    report("Collection, arm and shadow", figures, options.out)


if __name__ == "__main__":
    main()
