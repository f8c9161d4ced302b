"""rcl opens files of parameters; what it would wait for is refused before."""

import os
from pathlib import Path

import pytest

from sain_core.errors import ConfigError
from sain_core.ros.parameters import check_parameter_files


def test_a_fifo_is_refused_and_no_file_is_left_to_rcl(tmp_path: Path) -> None:
    fifo, good = tmp_path / "fifo", tmp_path / "good.yaml"
    os.mkfifo(fifo)
    good.write_text("{}")
    with pytest.raises(ConfigError, match="it is a FIFO"):
        check_parameter_files(["--ros-args", "--params-file", str(fifo)])
    check_parameter_files(["--ros-args", "--params-file", str(good)])
    check_parameter_files(["--ros-args", "--params-file", str(tmp_path / "none")])
