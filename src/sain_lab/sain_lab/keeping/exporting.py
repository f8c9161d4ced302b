"""What a robot without the laboratory needs: the belief, and the checkpoint in service."""

import shutil
from collections.abc import Iterator
from pathlib import Path

from sain_core.errors import DatasetError, OutputError
from sain_core.output import write_whole
from sain_lab.keeping.laboratory import BELIEF, Laboratory
from sain_model.dynamics.load import card_path


def export_laboratory(laboratory: Laboratory, out: Path) -> Iterator[tuple[Path, str]]:
    """Write the files; yield each with how it is used.

    Raises:
        DatasetError: there is nothing to export yet.
        OutputError: the folder cannot be written.
    """
    if not laboratory.belief_path.exists() and not laboratory.manifest.has_network:
        raise DatasetError(f"laboratory {laboratory.path} has learned nothing yet")
    if laboratory.belief_path.exists():
        path = write_whole(out / BELIEF, laboratory.belief_path.read_bytes())
        yield path, f"evaluate --controllers sain --belief {path}, or the parameter belief"
    if laboratory.manifest.has_network:
        source = laboratory.model_path(laboratory.manifest.service)
        try:
            for one in (card_path(source), source):
                shutil.copyfile(one, out / one.name)
        except OSError as error:
            raise OutputError(f"cannot write {out}: {error.strerror or error}") from error
        yield out / source.name, f"evaluate --controllers {out / source.name}"
