"""What is no bag, or no data set, is named, with what to do."""

import subprocess
import zipfile

import numpy as np
import pytest
from mcap.writer import Writer

from sain_bags.cli.recover import recover
from sain_bags.dataset.conversion import convert
from sain_bags.reading.reader import Bag
from sain_bringup.graph import executable
from sain_core.errors import DatasetError
from sain_model.data.dataset import load_dataset

FILES = {
    "ros1.bag": (b"#ROSBAG V2.0\n" + bytes(range(256)), "is a bag of ROS 1; `rosbags-convert"),
    "pointer.mcap": (b"version https://git-lfs.github.com/spec/v1\noid", "Git LFS.*`git lfs pull`"),
    "whole.mcap.zstd": (b"\x28\xb5\x2f\xfd" + bytes(range(90)), "compressed.*`zstd -d FILE`"),
    "bag.mcap.gz": (b"\x1f\x8b\x08" + bytes(90), "compressed as a whole; `gunzip FILE`"),
    "empty.mcap": (b"", r"is empty \(0 bytes\)"),
    "zeros.mcap": (bytes(4096), "begins with zeros only"),
    "README.md": ("# Überschrift\n".encode(), "is a text file, not a recording; give a bag"),
    "arm.urdf": (b'<?xml version="1.0"?>\n<robot name="a"/>', "describes a robot"),
    "failed.mcap": (b"\n<!DOCTYPE html><html>", "is a web page, as failed downloads"),
    "metadata.yaml": (b"rosbag2_bagfile_information:\n", "describes a bag; name the folder"),
    "noise.mcap": (np.random.default_rng(0).bytes(999), "begins with 5f 82 .*MCAP file with 89 4d"),
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_that_is_no_bag(name, tmp_path):
    content, said = FILES[name]
    file = tmp_path / name
    file.write_bytes(content)
    for open_it in (
        lambda: Bag(file),
        lambda: convert([file], tmp_path / "out"),
        lambda: recover(file, tmp_path / "saved"),
    ):
        with pytest.raises(DatasetError, match=f"{name}.*{said}"):
            open_it()
    assert not (tmp_path / "saved").exists()


def test_bags_and_data_sets_are_told_apart(tmp_path):
    bag, data = tmp_path / "bag", tmp_path / "data"
    bag.mkdir()
    data.mkdir()
    with (bag / "bag_0.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()
    (bag / "metadata.yaml").write_text("")
    np.savez(data / "shard-00000.npz", x=np.zeros(3))
    with zipfile.ZipFile(data / "other.zip", "w") as archive:
        archive.writestr("a.txt", "a")
    for path, said in (
        (bag, "holds no shards.*is the folder of a bag.*`sain to_dataset` converts it"),
        (bag / "bag_0.mcap", "is an MCAP file: a recording;.*`sain to_dataset` converts it"),
    ):
        with pytest.raises(DatasetError, match=said):
            load_dataset(path)
    (bag / "metadata.yaml").unlink()
    with pytest.raises(DatasetError, match="was not closed; `sain info` says what to do"):
        load_dataset(bag)
    for path, said in (
        (data, "is a data set of pushes, not a bag; `sain train` takes it"),
        (data / "shard-00000.npz", "is a shard of a data set .*`sain train` takes its folder"),
        (data / "other.zip", "is a zip archive; `unzip FILE` unpacks it"),
    ):
        with pytest.raises(DatasetError, match=said):
            Bag(path)


@pytest.mark.parametrize("command", ["info", "report", "view", "to_dataset", "recover", "play"])
def test_every_command_says_it_in_one_line(command, tmp_path):
    (tmp_path / "ros1.bag").write_bytes(FILES["ros1.bag"][0])
    line = [str(executable("sain_bags", command)), str(tmp_path / "ros1.bag")]
    line += ["--out", str(tmp_path / "out")] if command in ("to_dataset", "recover") else []
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 1
    (said,) = done.stderr.strip().splitlines()
    assert said.startswith(f"{command}: {tmp_path}/ros1.bag is a bag of ROS 1; `rosbags-convert")
