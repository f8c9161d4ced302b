"""Arrays in npz files: whole, or an error that names the file."""

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sain_core.errors import DatasetError
from sain_core.storage import read_arrays, write_arrays

ARRAYS = {
    "state": np.linspace(0.0, 1.0, 32).reshape(2, 16),
    "action": np.array([[0.1, 0.2, 0.05], [0.3, -0.2, 0.1]]),
    "episode": np.array([0, 1]),
    "friction": np.array([0.12, np.nan]),
}


def same(found: dict[str, np.ndarray], wanted: dict[str, np.ndarray]) -> bool:
    return found.keys() == wanted.keys() and all(
        np.array_equal(found[name], wanted[name], equal_nan=found[name].dtype.kind == "f")
        and found[name].dtype == wanted[name].dtype
        for name in wanted
    )


def test_no_flipped_bit_changes_a_number_in_silence(tmp_path):
    """One bit of every ninth byte, another one each time, and of each that leads to data."""
    path = tmp_path / "shard.npz"
    write_arrays(path, ARRAYS)
    content = path.read_bytes()
    directory = content.index(b"PK\x01\x02")
    outcomes = {"harmless": 0, "told": 0}
    for place in (*range(0, directory, 9), *range(directory, len(content))):
        damaged = bytearray(content)
        damaged[place] ^= 1 << place % 8
        path.write_bytes(damaged)
        try:
            assert same(read_arrays(path), ARRAYS), f"a bit of byte {place} went unseen"
            outcomes["harmless"] += 1  # a date, say
        except DatasetError as error:
            assert str(path) in str(error)
            outcomes["told"] += 1
    assert outcomes["told"] > outcomes["harmless"] > 0


def test_a_truncated_file_is_refused_wherever_it_ends(tmp_path):
    path = tmp_path / "shard.npz"
    write_arrays(path, ARRAYS)
    content = path.read_bytes()
    for size in range(0, len(content), 7):
        path.write_bytes(content[:size])
        with pytest.raises(DatasetError, match=r"shard\.npz is not a whole \.npz file"):
            read_arrays(path)


def test_what_is_no_archive_is_refused_and_never_unpickled(tmp_path):
    canary = tmp_path / "canary"

    class Trap:
        def __reduce__(self):
            return (Path.touch, (canary,))

    path = tmp_path / "shard.npz"
    np.save(tmp_path / "trap.npy", np.array([Trap()], dtype=object), allow_pickle=True)
    (tmp_path / "trap.npy").rename(path)
    with pytest.raises(DatasetError, match="one array of NumPy"):
        read_arrays(path)
    np.savez(path.open("wb"), trap=np.array([Trap()], dtype=object))
    with pytest.raises(DatasetError, match="is not a whole"):
        read_arrays(path)
    assert not canary.exists()
    with pytest.raises(DatasetError, match=r"none\.npz does not exist"):
        read_arrays(tmp_path / "none.npz")


FILL = """
import resource, sys
import numpy as np
from pathlib import Path
from sain_core.errors import OutputError
from sain_core.storage import write_arrays
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
path = Path(sys.argv[1])
random = np.random.default_rng(0)
write_arrays(path, {"state": random.random(1_000)})
try:
    write_arrays(path, {"state": random.random(100_000)})
except OutputError as error:
    print(error)
"""


def test_a_full_disk_leaves_the_file_before_whole(tmp_path):
    """A limit on the size of files stands for the disk that is full."""
    path = tmp_path / "shard.npz"
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[1] != 20_000
    done = subprocess.run([sys.executable, "-c", FILL, str(path)], text=True, capture_output=True)
    assert done.stdout == f"cannot write {path}: File too large\n", done.stderr
    assert len(read_arrays(path)["state"]) == 1_000
    assert list(tmp_path.iterdir()) == [path]
