"""The rows of all tables, in their order."""

from pathlib import Path

from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import NoMotion, Row, published_rows
from benchmarks.real.trees import Trees


def all_rows(pushes: PushTable, work: Path, seed: int) -> list[Row]:
    """Return the rows of all tables; what many folds share is kept in a folder of work."""
    return [NoMotion(), *published_rows(pushes), Trees(seed=seed)]
