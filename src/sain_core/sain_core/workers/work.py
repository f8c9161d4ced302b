"""What workers do, and what it depends on."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from sain_core.provenance import versions

Job = TypeVar("Job")
Done = TypeVar("Done")
JobIn = TypeVar("JobIn", contravariant=True)
DoneOut = TypeVar("DoneOut", covariant=True)


class Runner(Protocol[JobIn, DoneOut]):
    """Does jobs, one after the other, and keeps between them what it needs."""

    def run(self, job: JobIn, /) -> DoneOut:
        """Do a job; a `SainError` is one of the whole work."""
        ...

    def close(self) -> None:
        """Release what it keeps."""
        ...


class FunctionRunner(Generic[Job, Done]):
    """A `Runner` that calls a function and keeps nothing."""

    def __init__(self, function: Callable[[Job], Done]) -> None:
        """Store the function."""
        self._function = function

    def run(self, job: Job) -> Done:
        """Do a job."""
        return self._function(job)

    def close(self) -> None:
        """There is nothing to release."""


@dataclass(frozen=True)
class Software:
    """What decides about the bytes that work gives.

    Attributes:
        sources: packages whose Python files count.
        packages: distributions whose versions count.
    """

    sources: tuple[str, ...]
    packages: tuple[str, ...]

    def found(self) -> dict[str, str]:
        """Return it as it is on this machine."""
        digest = hashlib.sha256()
        for name in self.sources:
            spec = find_spec(name)
            assert spec is not None and spec.origin is not None
            for path in sorted(Path(spec.origin).parent.rglob("*.py")):
                digest.update(path.read_bytes())
        return {**versions(*self.packages), "sain": digest.hexdigest()[:12]}


@dataclass(frozen=True)
class Work(Generic[Job, Done]):
    """Work that workers share.

    Attributes:
        start: makes, in a worker, what does the jobs; it can be pickled.
        software: what the results depend on.
        name: returns the name of a job for errors.
        goes_on: whether the same command continues after a stop.
    """

    start: Callable[[], Runner[Job, Done]]
    software: Software
    name: Callable[[Job], str]
    goes_on: bool = True

    @property
    def after_a_stop(self) -> str:
        """The end of an error that stops the work."""
        whole = "; what is in the folder is whole, and the same command goes on from there"
        return whole if self.goes_on else ""
