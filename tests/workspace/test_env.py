"""`./env`: what it sets, what it refuses, and that nothing half-made is ever used."""

import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

COMMANDS_OF_THE_SCRIPTS = """
    awk basename bash cat cksum date diff dirname env find flock grep head id ln mkdir mv readlink
    rm sed sha256sum sleep sort tail tput tr wc xargs
""".split()  # noqa: SIM905


def run(*command: str | Path, cwd: Path | None = None, **variables: str | None):
    """Runs a command in this environment, with some variables changed or taken out (None)."""
    environment = {**os.environ, **variables}
    environment = {name: value for name, value in environment.items() if value is not None}
    return subprocess.run(
        [str(part) for part in command], cwd=cwd, env=environment, capture_output=True, text=True,
        timeout=60, check=False,
    )  # fmt: skip


@pytest.fixture
def tools_only(tmp_path: Path):
    """Makes a PATH that has only the named commands and what the scripts themselves use."""

    def make(*extra: str) -> str:
        folder = tmp_path / "bin"
        folder.mkdir()
        for name in (*COMMANDS_OF_THE_SCRIPTS, *extra):
            (folder / name).symlink_to(shutil.which(name))
        return str(folder)

    return make


def python_that(tmp_path: Path, when_making_a_venv: str) -> str:
    """An interpreter that passes the checks and then does the given thing for a venv."""
    path = tmp_path / "python3.11"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{when_making_a_venv}\n')
    path.chmod(0o755)
    return str(path)


# --- running commands ---------------------------------------------------------------------------


def test_exit_code_arguments_and_folder_are_the_caller_s(root, tmp_path):
    result = run(
        root / "env",
        "sh",
        "-c",
        'pwd; printf "<%s>" "$@"; exit 7',
        "_",
        "a b",
        "",
        "*",
        cwd=tmp_path,
    )
    assert result.returncode == 7
    assert result.stdout == f"{tmp_path}\n<a b><><*>"
    assert result.stderr == ""


def test_works_through_a_symbolic_link(root, tmp_path):
    (tmp_path / "link").symlink_to(root / "env")
    result = run(tmp_path / "link", "sh", "-c", "echo $VIRTUAL_ENV", cwd=tmp_path)
    assert result.stdout == f"{root}/.venv\n"


def test_without_a_command_it_says_what_it_is_for(root):
    assert run(root / "env").returncode == 2
    result = run(root / "env", "--help")
    assert result.returncode == 0
    assert result.stdout.startswith("./env CMD")


@pytest.mark.parametrize(
    ("variable", "given", "seen"),
    [
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", None, "LOCALHOST"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET", "SUBNET"),
        ("OMP_NUM_THREADS", None, "1"),
        ("OMP_NUM_THREADS", "4", "4"),
        ("RMW_IMPLEMENTATION", None, "rmw_fastrtps_cpp"),
        ("ROS_DISTRO", None, "jazzy"),
    ],
)
def test_defaults_yield_to_the_user(root, variable, given, seen):
    assert run(root / "env", "printenv", variable, **{variable: given}).stdout == f"{seen}\n"


@pytest.mark.parametrize("variable", ["PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH"])
def test_one_inside_the_other_adds_nothing(root, variable):
    once = run(root / "env", "printenv", variable)
    twice = run(root / "env", root / "env", "printenv", variable)
    assert once.stdout == twice.stdout != ""


def test_what_the_user_had_on_the_paths_stays_behind_ours(root):
    result = run(root / "env", "printenv", "PYTHONPATH", PYTHONPATH="/mine", AMENT_PREFIX_PATH=None)
    assert result.stdout.endswith(":/mine\n")


def test_another_distribution_s_libraries_are_kept_out(root):
    if "/opt/ros/jazzy" in os.environ.get("AMENT_PREFIX_PATH", ""):
        pytest.skip("a full Jazzy install is in use")
    humble = "/opt/ros/humble/lib/python3.10/site-packages"
    result = run(
        root / "env", "printenv", "PYTHONPATH", "AMENT_PREFIX_PATH",
        PYTHONPATH=humble, AMENT_PREFIX_PATH="/opt/ros/humble", ROS_DISTRO="humble",
    )  # fmt: skip
    assert result.stdout.count("\n") == 2
    assert "humble" not in result.stdout


def test_the_middleware_and_the_numerics_live_in_one_process(root):
    """And Python starts once: the wheels would start it again, were the library path not set."""
    code = "import rclpy, torch, numba, pybullet, sain_interfaces.msg, os; print(os.getpid())"
    process = subprocess.Popen(
        [str(root / "env"), "python", "-c", code], stdout=subprocess.PIPE, text=True
    )
    out, _ = process.communicate(timeout=120)
    assert process.returncode == 0
    assert out.splitlines()[-1] == str(process.pid)


# --- noticing what has to be rebuilt ------------------------------------------------------------


def recipe_of(checkout: Path) -> str:
    script = f"root={checkout}; . {checkout}/tools/recipe.sh; workspace_recipe"
    return run("bash", "-euc", script).stdout


@pytest.mark.parametrize(
    ("path", "rebuilds"),
    [
        ("src/a/msg/A.msg", True),
        ("src/a/srv/A.srv", True),
        ("src/a/package.xml", True),
        ("src/a/setup.py", True),
        ("src/a/setup.cfg", True),
        ("src/a/CMakeLists.txt", True),
        ("src/a/resource/a", True),
        ("requirements/ros.in", True),
        ("requirements/python.in", False),
        ("src/a/a/node.py", False),
        ("src/a/launch/a.launch.py", False),
        ("src/a/config/a.yaml", False),
    ],
)
def test_edits_that_need_a_rebuild(make_checkout, path, rebuilds):
    checkout = make_checkout()
    file = checkout / path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("before\n")
    before = recipe_of(checkout)
    assert before == recipe_of(checkout) != ""
    file.write_text("after\n")
    assert (recipe_of(checkout) != before) == rebuilds


@pytest.mark.parametrize(
    ("path", "rebuilds"),
    [("src/a/launch/b.launch.py", True), ("src/a/config/b.yaml", True), ("src/a/a/node.py", False)],
)
def test_new_files_that_need_a_rebuild(make_checkout, path, rebuilds):
    checkout = make_checkout()
    before = recipe_of(checkout)
    (checkout / path).parent.mkdir(parents=True)
    (checkout / path).touch()
    assert (recipe_of(checkout) != before) == rebuilds


def test_only_packages_that_changed_are_rebuilt(make_checkout):
    checkout = make_checkout()
    for package in ("edited", "kept", "removed"):
        (checkout / "src" / package).mkdir()
        (checkout / "src" / package / "setup.py").write_text("before\n")
    (checkout / "ros2_ws/install").mkdir()
    (checkout / "ros2_ws/install/recipe").write_text(recipe_of(checkout))
    (checkout / "src/edited/setup.py").write_text("after\n")
    (checkout / "src/removed/setup.py").unlink()
    (checkout / "src/added").mkdir()
    (checkout / "src/added/setup.py").touch()
    sources = f"root={checkout}; . $root/tools/recipe.sh; . $root/tools/setup.sh"
    result = run("bash", "-uc", f"{sources}; cd $workspace; changed_packages")
    assert result.stdout.split() == ["added", "edited", "removed"]


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
    script = f"root={root}; . $root/tools/recipe.sh; ros_kind"
    result = run("bash", "-euc", script, ROS_DISTRO=distribution, AMENT_PREFIX_PATH=prefixes)
    assert result.stdout == f"{kind}\n"


# --- refusing, in one line and before anything is made ------------------------------------------


def assert_refused(checkout: Path, result, *words: str) -> None:
    assert result.returncode == 1
    assert result.stdout == ""
    assert result.stderr.startswith("./env: ")
    assert result.stderr.count("\n") == 1
    for word in words:
        assert word in result.stderr
    assert not (checkout / ".venv").exists()


@pytest.mark.parametrize(
    "name", ["with space", "dollar$", "quote'", "colon:", "star*", "back\\slash"]
)
def test_a_path_that_colcon_cannot_work_in(make_checkout, name):
    checkout = make_checkout(name)
    assert_refused(checkout, run(checkout / "env", "true"), name, "move the checkout")


@pytest.mark.parametrize(
    ("there", "missing", "package"),
    [
        (("g++", "make", "cmake"), "gcc", "build-essential"),
        (("gcc", "make", "cmake"), "g++", "build-essential"),
        (("gcc", "g++", "cmake"), "make", "build-essential"),
        (("gcc", "g++", "make"), "cmake", "cmake"),
        (("gcc", "g++", "make", "cmake"), "python3.11", "python3.11-venv"),
    ],
)
def test_a_missing_tool(make_checkout, tools_only, there, missing, package):
    checkout = make_checkout()
    result = run(checkout / "env", "true", PATH=tools_only(*there), ROS_DISTRO=None)
    assert_refused(
        checkout, result, f"needs {missing}", f"sudo apt install {package.split('-')[0]}", package
    )


def test_a_python_without_venv_or_headers(make_checkout, tmp_path, tools_only):
    checkout = make_checkout()
    python = tmp_path / "python3.12"
    python.write_text('#!/bin/sh\n[ -z "$2" ]\n')  # can run nothing but an empty program
    python.chmod(0o755)
    path = f"{tmp_path}:{tools_only('gcc', 'g++', 'make', 'cmake')}"
    result = run(checkout / "env", "true", PATH=path, ROS_DISTRO=None)
    assert_refused(checkout, result, "sudo apt install python3.12-venv python3.12-dev")


# --- failing, being interrupted, and waiting ----------------------------------------------------


def test_a_failed_step_is_named_with_the_end_of_its_log(make_checkout, tmp_path):
    checkout = make_checkout()
    python = python_that(tmp_path, "seq 100; echo the disk is full; exit 1")
    result = run(checkout / "env", "true", SAIN_PYTHON=python)
    assert result.returncode == 1
    assert "Failed: Python environment" in result.stderr
    assert "the disk is full" in result.stderr
    assert result.stderr.count("\n") < 20
    assert not (checkout / ".venv").exists()


@pytest.mark.parametrize("by", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_an_interrupted_run_ends_what_it_started_and_leaves_nothing(make_checkout, tmp_path, by):
    checkout = make_checkout()
    told = tmp_path / "pid"
    python = python_that(tmp_path, f"mkdir {checkout}/.venv; echo $$ >{told}; sleep 60")
    process = start_set_up(checkout, python)
    wait_until(lambda: told.exists() and told.read_text())
    os.killpg(process.pid, by)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "Interrupted" in err
    assert not (checkout / ".venv").exists()
    wait_until(lambda: not Path("/proc", told.read_text().strip()).exists())


def test_a_second_run_waits_for_the_first(make_checkout, tmp_path):
    checkout = make_checkout()
    holder = ["flock", checkout / "ros2_ws/.setup.lock", "sh", "-c", "echo held; read _"]
    first = subprocess.Popen(holder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert first.stdout.readline() == "held\n"
    second = start_set_up(checkout, python_that(tmp_path, f"echo ran >>{tmp_path}/ran; exit 1"))
    assert "waiting" in second.stderr.readline()
    assert not (tmp_path / "ran").exists()
    first.communicate("\n", timeout=20)
    second.communicate(timeout=20)
    assert (tmp_path / "ran").read_text() == "ran\n"


def start_set_up(checkout: Path, python: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        # nohup and a shell's & have signals ignored, which a shell that inherits it cannot undo
        ["env", "--default-signal=INT,HUP", checkout / "env", "true"],
        env={**os.environ, "SAIN_PYTHON": python},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,  # a process group of its own, as a terminal gives it
    )


def wait_until(condition, timeout_s: float = 20.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)
