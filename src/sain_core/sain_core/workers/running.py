"""Work done by this process, by others, or by a Ray cluster."""

from collections.abc import Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass

from sain_core.config import Config, option
from sain_core.workers.pool import Done, Job, ProcessPool, Work, WorkerPool, as_finished, in_order
from sain_core.workers.ray_pool import RayPool, ray_cluster


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
    """Do all jobs and yield their results; workers end with this process, killed or not.

    One worker without Ray is this process.

    Args:
        work: what to do.
        jobs: to be done, each by one worker.
        options: who does them.
        ordered: yield in the order of the jobs, else as they come.

    Raises:
        ConfigError: there is no such Ray cluster.
        SainError: a job cannot be done.
    """
    size = min(options.workers, len(jobs))
    if not jobs:
        return
    with ExitStack() as stack:
        if size == 1 and not options.ray:
            yield from map(stack.enter_context(closing(work.start())).run, jobs)
            return
        pool: WorkerPool[Job, Done]
        if options.ray:
            ray = stack.enter_context(ray_cluster(options.ray, size))
            pool = stack.enter_context(closing(RayPool(ray, size, work)))
        else:
            pool = stack.enter_context(closing(ProcessPool(size, work)))
        yield from (in_order if ordered else as_finished)(pool, jobs)
