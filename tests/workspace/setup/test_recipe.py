"""`./env` notices what has to be made again, and makes no more than that."""

import subprocess
from pathlib import Path

import pytest

from tests.workspace.command import run

PROBE = '"$(sed -n "/^packages_now=/p;/^messages_now=/,/cksum)\\"$/p" {env})"'
PROBE += '; echo "$packages_now"; echo "$messages_now"'


@pytest.fixture
def checkout(make_checkout):
    return make_checkout()


def made_from(checkout: Path) -> list[str]:
    """What packages and messages would be made from."""
    script = f"root={checkout}; ros=wheels; eval " + PROBE.format(env=checkout / "env")
    return run("bash", "-euc", script).stdout.splitlines()


@pytest.mark.parametrize(
    ("path", "packages", "messages"),
    [
        ("pyproject.toml", True, False),
        ("requirements.txt", True, False),
        ("src/sain_interfaces/msg/Push.msg", False, True),
        ("src/sain_interfaces/msg/New.msg", False, True),
        ("src/sain_interfaces/CMakeLists.txt", False, True),
        ("tools/missing/tf2_msgs/msg/TFMessage.msg", False, True),
        ("tools/missing/tf2_msgs/CMakeLists.txt", False, True),
        ("tools/messages.cmake", False, True),
        ("src/sain_core/sain_core/scene.py", False, False),
    ],
)
def test_what_an_edit_makes_again(checkout, path, packages, messages):
    before = made_from(checkout)
    assert len(before) == 2 and before == made_from(checkout)
    (checkout / path).parent.mkdir(parents=True, exist_ok=True)
    with (checkout / path).open("a") as file:
        file.write("# edited\n")
    assert [a != b for a, b in zip(before, made_from(checkout), strict=True)] == [
        packages,
        messages,
    ]


@pytest.mark.parametrize(
    ("distribution", "prefixes", "kind"),
    [
        ("jazzy", "/opt/ros/jazzy", "system"),
        ("jazzy", "/home/me/ws/install/a:/opt/ros/jazzy", "system"),
        ("humble", "/opt/ros/humble", "wheels"),
        ("jazzy", "/home/me/sain/.venv", "wheels"),
        (None, None, "wheels"),
    ],
)
def test_a_sourced_jazzy_install_is_used(root, distribution, prefixes, kind):
    script = f"eval \"$(sed -n '/^ros=wheels/,/^if/p' {root}/env)\"; echo $ros"
    result = run("bash", "-euc", script, ROS_DISTRO=distribution, AMENT_PREFIX_PATH=prefixes)
    assert result.stdout == f"{kind}\n", result.stderr


@pytest.mark.parametrize(
    ("command", "group"),
    [
        ("python -m pytest tests", "test"),
        ("ruff check", "lint"),
        ("ros2 run sain_bringup graph --faults none", "robots"),
        ("ros2 run sain_bringup graph --robot=so101", "robots"),
        ("ros2 run sain_bringup graph --driver elsewhere", "robots"),
        ("sain to_dataset bag --format lerobot --out d", "lerobot"),
        ("sain collect --ray auto --out d", "ray"),
        ("ros2 run sain_sim sim_node", ""),
        ("--with docs true", "docs"),
    ],
)
def test_a_command_brings_the_group_that_it_needs(root, command, group):
    text = (root / "env").read_text()
    part = text[text.index("declare -A group_of") : text.index("# Files by name")]
    script = f"{part}\necho ${{groups[@]:1}}"
    done = subprocess.run(
        ["bash", "-euc", script, "_", *command.split()], capture_output=True, text=True
    )
    assert set(done.stdout.split()) == ({group} if group else set()), done.stderr
