"""`sain` without ROS: what `pip install .` installs, and what is said when more is asked."""

import subprocess
import sys
from importlib.metadata import Distribution
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of a copy of the checkout: a build leaves files beside what it builds."""
    folder = tmp_path_factory.mktemp("wheel")
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    listed = folder / "listed"
    listed.write_text("\n".join(n for n in tracked.stdout.splitlines() if (ROOT / n).exists()))
    copy = folder / "copy"
    copy.mkdir()
    archive = folder / "all.tar"
    subprocess.run(["tar", "cf", archive, "-T", listed], cwd=ROOT, check=True)
    subprocess.run(["tar", "xf", archive], cwd=copy, check=True)
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-q"]
    subprocess.run([*command, "-w", folder, copy], check=True)
    return next(folder.glob("sain-*.whl"))


def test_the_wheel_has_every_part_that_needs_no_ros(wheel: Path, tmp_path: Path) -> None:
    with ZipFile(wheel) as archive:
        archive.extractall(tmp_path)
    for path in (
        "sain_model/checkpoints/sain.safetensors",
        "sain_sim/engines/bullet_cell.py",
        "sain_gym/push_env.py",
        "sain_pusht/pusht.safetensors",
    ):
        assert (tmp_path / path).exists(), path
    (info,) = tmp_path.glob("sain-*.dist-info")
    entries = {(entry.group, entry.name) for entry in Distribution.at(info).entry_points}
    assert ("console_scripts", "sain") in entries
    assert {("sain.dynamics", name) for name in ("planar", "checkpoint", "bullet")} <= entries
    required = Distribution.at(info).requires or []
    pinned = [line for line in required if "extra ==" not in line]
    assert all("==" in line for line in pinned), pinned


def run_without_ros(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    """Run `sain` where nothing of ROS 2 can be imported."""
    blocked = "import sys\n"
    blocked += "sys.modules |= dict.fromkeys(('rclpy', 'sain_interfaces', 'std_msgs'))\n"
    blocked += f"from sain_core.cli.program import main\nsys.exit(main({arguments!r}))\n"
    return subprocess.run(
        [sys.executable, "-c", blocked], cwd=folder, capture_output=True, text=True
    )


def test_commands_work_without_ros(tmp_path: Path) -> None:
    made = run_without_ros(["collect", "--episodes", "1", "--out", "data"], tmp_path)
    assert made.returncode == 0, made.stderr
    assert "1 episodes" in made.stderr and list((tmp_path / "data").glob("*.npz"))
    asked = run_without_ros(["collect", "--help"], tmp_path)
    assert asked.stdout.startswith("usage: sain collect")


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (
            ["trian"],
            2,
            "sain: there is no command 'trian' (did you mean 'train'?); see sain --help",
        ),
        (["record"], 1, "sain record needs ROS 2 (rclpy), which is not installed here: run it"),
        (["sim_node"], 1, "sain sim_node needs ROS 2"),
        (["evaluate", "--scenes", "0"], 2, "evaluate: --scenes is 0; it must be at least 1"),
    ],
)
def test_what_cannot_be_is_said(arguments: list[str], code: int, text: str, tmp_path: Path) -> None:
    found = run_without_ros(arguments, tmp_path)
    assert found.returncode == code
    assert text in found.stderr and "Traceback" not in found.stderr
