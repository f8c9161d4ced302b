"""Work done by this process, by others, or by a Ray cluster."""

from collections.abc import Generator, Sequence
from contextlib import closing
from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.workers.pool import Done, Job, Work, run_on_processes
from sain_core.workers.ray_pool import run_on_ray


@dataclass(frozen=True, kw_only=True)
class WorkerOptions(Config):
    """Who does the work. What is written does not depend on it."""

    workers: int = option(
        1,
        "processes that share the work; planning takes longer with more of them than cores",
        minimum=1,
        maximum=4096,
    )
    ray: str = option(
        "",
        "Ray cluster of the workers: HOST:PORT; auto: this machine's; local: a new one on this"
        " machine",
    )


def run_on_workers(
    work: Work[Job, Done], jobs: Sequence[Job], options: WorkerOptions, ordered: bool = True
) -> Generator[Done, None, None]:
    """Do all jobs; yield their results in the order of the jobs, or else as they come.

    One worker without Ray is this process. Workers end with this process, killed or not.

    Raises:
        ConfigError: there is no such Ray cluster.
        SainError: a job cannot be done.
    """
    size = min(options.workers, len(jobs))
    if not jobs:
        return
    if options.ray:
        yield from run_on_ray(work, jobs, size, ordered, options.ray)
    elif size > 1:
        yield from run_on_processes(work, jobs, size, ordered)
    else:
        with closing(work.start()) as runner:
            yield from map(runner.run, jobs)
