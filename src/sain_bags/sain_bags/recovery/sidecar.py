"""What stands beside the files of a damaged bag."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

from sain_bags.bag.metadata import METADATA_FILE, read_metadata, storage_of
from sain_bags.bag.parts import earlier, mcap_files
from sain_core.errors import DatasetError
from sain_core.guarding.kinds import describe

DEFAULT_DISTRO: Final = "jazzy"


@dataclass(frozen=True)
class Sidecar:
    """The content of ``metadata.yaml``, as far as it can be read."""

    files: tuple[Path, ...]  # of the bag, in their order
    custom_data: Mapping[str, str] = field(default_factory=dict)
    ros_distro: str = DEFAULT_DISTRO
    counts: Mapping[str, int] | None = None  # messages by topic
    lost: str = ""  # what is lost for certain
    note: str = ""  # what is amiss but no loss
    is_read: bool = True  # whether the file could be


def complete_sidecar(sidecar: Sidecar, about: Mapping[str, Any], was_more: bool) -> Sidecar:
    """Complete the content of ``metadata.yaml`` from the metadata that is left in an MCAP file.

    `was_more`: the file once had metadata of its bag.
    """
    if sidecar.is_read:
        return sidecar
    if not about:
        lost = sidecar.lost or ("the metadata of the bag in the file" if was_more else "")
        return replace(sidecar, lost=lost)
    custom_data, ros_distro = _about_bag(about)
    note = sidecar.note or f"{METADATA_FILE} cannot be read; the MCAP file's metadata are used"
    return replace(sidecar, custom_data=custom_data, ros_distro=ros_distro, lost="", note=note)


def read_sidecar(source: Path) -> Sidecar:
    """Find the MCAP files of a bag, or the one file that it is, and what stands beside them.

    Of a recording that was not closed, also those of earlier ones that it goes on with.

    Raises:
        DatasetError: there is no such file.
    """
    if source.is_file():
        if storage_of(source) != "mcap":
            raise DatasetError(f"{source} is a sqlite3 file; `sqlite3 FILE .recover` saves those")
        return Sidecar((source,), is_read=False)
    files, is_closed = mcap_files(source), (source / METADATA_FILE).is_file()
    if not is_closed:
        files = (*mcap_files(earlier(source)), *files)
    if not files:
        what = f"; it {found}" if (found := describe(source)) else ""
        raise DatasetError(f"there is no MCAP file at {source}{what}")
    if not is_closed:
        note = f"{METADATA_FILE} is missing: the recording was not closed"
        return Sidecar(files, note=note, is_read=False)
    try:
        return _sidecar(files, source, read_metadata(source))
    except DatasetError:
        lost = f"{METADATA_FILE} cannot be read: custom data is lost"
        return Sidecar(files, lost=lost, is_read=False)


def _sidecar(files: tuple[Path, ...], source: Path, about: Mapping[str, Any]) -> Sidecar:
    counts: dict[str, int] = {}
    for topic in about["topics_with_message_count"]:
        name = topic["topic_metadata"]["name"]
        counts[name] = counts.get(name, 0) + topic["message_count"]
    missing = [name for name in about["relative_file_paths"] if not (source / name).is_file()]
    return Sidecar(
        files,
        *_about_bag(about),
        counts,
        f"{METADATA_FILE} names files that are not there: {', '.join(missing)}" if missing else "",
    )


def _about_bag(about: Mapping[str, Any]) -> tuple[dict[str, str], str]:
    return dict(about["custom_data"]), about["ros_distro"] or DEFAULT_DISTRO
