"""The rows of all tables, in their order."""

from pathlib import Path

from benchmarks.real.network import ALONE, NetworkRow
from benchmarks.real.physics import IdentifiedPhysics, NominalPhysics
from benchmarks.real.pushes import PushTable
from benchmarks.real.rows import NoMotion, Row, published_rows
from benchmarks.real.trees import Trees


def all_rows(pushes: PushTable, work: Path, seed: int) -> list[Row]:
    """Return the rows of all tables; priors and trainings are kept in a folder of work."""
    identified = IdentifiedPhysics(work)
    return [
        NoMotion(),
        NominalPhysics(),
        identified,
        *published_rows(pushes),
        NetworkRow(work, config=ALONE),
        Trees(seed=seed),
        Trees(identified, seed=seed),
        NetworkRow(work, identified),
    ]
