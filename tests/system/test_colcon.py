"""`colcon build` of the packages as they stand, and `ros2 run` from what it installs."""

import os
import subprocess

from tests.paths import ROOT


def test_colcon_builds_the_packages_and_ros2_runs_them(tmp_path):
    (tmp_path / "src").mkdir()  # the messages are those of the environment: they take a minute
    for package in ("sain_core", "sain_sim"):
        (tmp_path / "src" / package).symlink_to(ROOT / "src" / package)
    done = subprocess.run(["colcon", "build"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    start = f". {tmp_path}/install/setup.sh && ros2 run sain_sim sim_node --help && which -a python"
    start += " && python -c 'import sain_sim, importlib.metadata as m; print(sain_sim.__file__);"
    start += ' print({e.name for e in m.entry_points(group="sain.dynamics")})\''
    started = subprocess.run(
        ["sh", "-c", start], capture_output=True, text=True, env={**os.environ}
    )
    assert started.returncode == 0, started.stderr
    assert "usage: ros2 run sain_sim sim_node" in started.stdout
    assert f"{tmp_path}/install/sain_sim/lib/python3" in started.stdout
    assert "'bullet'" in started.stdout
