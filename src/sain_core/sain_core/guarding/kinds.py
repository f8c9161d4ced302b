"""What a file or a folder is that a command was given in place of a bag or a data set.

A file is recognised by its first bytes, whatever its name is.
"""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from sain_core.errors import UntrustedFileError
from sain_core.guarding.untrusted import HEAD, STAND_INS, open_regular, stand_in

MCAP: Final = b"\x89MCAP0\r\n"
SQLITE: Final = b"SQLite format 3\0"
BEGINNINGS: Final = {  # of files: what they are, and what to do
    MCAP: "is an MCAP file: a recording; `sain info` shows it, `sain to_dataset` converts it",
    SQLITE: "is a sqlite3 file, perhaps of a bag; `sain to_dataset` converts bags",
    b"#ROSBAG V": "is a bag of ROS 1; `rosbags-convert --src BAG --dst FOLDER` makes one of ROS 2",
    **STAND_INS,
    b"PK": "is a zip archive; `unzip FILE` unpacks it",
    b"\x93NUMPY": "is one array of NumPy (.npy): neither a bag nor a data set",
}
NOT_CLOSED: Final = "is a bag without metadata.yaml: it was not closed; `sain info` says what to do"
WANTED: Final = "give a bag (its folder, .mcap or .db3) or the folder of a data set"
SHEETS: Final = (b"xl/", b"[Content_Types]", b"opendocument")  # how an .xlsx or .ods begins
SHARDS: Final = "shard-*.npz"
DATA_SET: Final = "is a data set of pushes, not a bag; "
FOLDERS: Final = {  # a pattern of what is in a folder: what that is, and what to do
    "metadata.yaml": "is the folder of a bag: a recording; `sain to_dataset` converts it",
    SHARDS: DATA_SET + "`sain train` takes it",
    "meta/info.json": DATA_SET + "it is in LeRobot's format, which `lerobot` reads",
    "data/main_data.hdf5": DATA_SET + "it is in Minari's format, which `minari` reads",
    "*-[0-9]*.parquet": DATA_SET + "it is in Parquet, which pandas and polars read",
    "laboratory.json": "is a laboratory; `sain lab` shows it",
    "*.mcap": NOT_CLOSED,
    "*.db3": NOT_CLOSED,
    "*.zstd": "has compressed files and no metadata.yaml; `zstd -d FILE` unpacks each",
    "*.bag": "has bags of ROS 1; `rosbags-convert --src BAG --dst FOLDER` makes one of ROS 2",
    "*/metadata.yaml": "has bags in folders below it; name one of them",
}


def describe(path: Path, texts: bool = True) -> str:
    """Return what a file or a folder is, and what to do with it; empty: it is not recognised.

    Without `texts`, no file of text is recognised.
    """
    if path.is_dir():
        found = (text for pattern, text in FOLDERS.items() if any(path.glob(pattern)))
        return next(found, "" if any(path.iterdir()) else "is an empty folder")
    try:
        with open_regular(path) as file:
            head = file.read(HEAD)
    except (OSError, UntrustedFileError):
        return ""
    if not head:
        return "is empty (0 bytes): its recording or its download did not finish; get it again"
    if not any(head):
        return "begins with zeros only: its recording or its download did not finish"
    return next(_kinds(path, head, texts), "")


def _kinds(path: Path, head: bytes, texts: bool) -> Iterator[str]:
    if head.startswith(b"PK") and b".npy" in head:
        yield "is a shard of a data set (.npz); `sain train` takes its folder"
    if head.startswith(b"PK") and any(sign in head for sign in SHEETS):
        yield "is a spreadsheet (.xlsx or .ods); save its table as CSV (UTF-8)"
    yield from (text for magic, text in BEGINNINGS.items() if head.startswith(magic))
    with suppress(UnicodeDecodeError):
        if not texts:
            return
        # A character may be cut off at the end of what was read.
        yield from _texts(path, head.decode(errors="strict" if len(head) < HEAD else "ignore"))


def _texts(path: Path, text: str) -> Iterator[str]:
    if not text.isprintable() and any(ord(sign) < 9 for sign in text):
        return
    begin = text.lstrip("\ufeff \t\r\n").lower()
    if path.name == "metadata.yaml" or "rosbag2_bagfile_information" in text:
        yield "describes a bag; name the folder that it is in"
    if "<robot" in begin:
        yield "describes a robot (URDF), not a recording"
    if stands_in := stand_in(text.encode()):
        yield stands_in
    if path.suffix == ".csv":
        yield "is a table (CSV); `sain real_import` takes recordings of pushes"
    yield f"is a text file, not a recording; {WANTED}"
