# ruff: noqa: E501 - a case is a line
"""Every executable as it is started: its help, its errors and Ctrl-C while it starts."""

import os
import subprocess
import sys
from dataclasses import fields, is_dataclass
from functools import cache
from importlib import import_module
from typing import Any, get_type_hints

import pytest

from sain_bringup.graph import executable
from sain_core.cli.command_line import Command, load
from sain_core.cli.node_command import NodeCommand, describe_parameters
from tests.workspace.source_tree import PYTHON_PACKAGES, console_scripts
from tests.workspace.starter import Starter

SCRIPTS = [(package, name) for package in PYTHON_PACKAGES for name in console_scripts(package)]
HEAVY = {"torch", "pybullet", "numba", "rclpy", "matplotlib"}
INTERRUPT = """
import os, signal, sys
from importlib import import_module

class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Finder())
sys.argv = {arguments!r}
{start}
"""
ENTRY = "sys.exit(getattr(import_module('{package}.commands'), '{name}')())"
KEPT = (".sain-files", "episodes.jsonl")  # of a folder that was claimed, to be continued
COLUMNS = 100  # of the terminal
LAUNCHER = "import runpy; runpy.run_path('{path}', run_name='__main__')"


@pytest.fixture(scope="module")
def start():
    """Starts an executable in a process of its own, without paying again for what all import."""
    with Starter() as starter:
        yield lambda package, name, *arguments: starter.start(
            executable(package, name), *arguments, COLUMNS=str(COLUMNS)
        )


@pytest.fixture(scope="module")
def help_of(start):
    """What a command prints for --help."""
    return cache(lambda package, name: start(package, name, "--help"))


def said(text: str) -> str:
    """What a process has written, without frames."""
    return " ".join(text.replace("│", " ").split())


def entry(package: str, name: str) -> Command | NodeCommand:
    commands = vars(import_module(f"{package}.commands")).values()
    (found,) = [
        one
        for one in commands
        if isinstance(one, Command | NodeCommand) and one.name == f"{package} {name}"
    ]
    return found


def test_each_is_started_by_the_interpreter_of_the_environment():
    for path in (executable(*script) for script in SCRIPTS):
        assert os.access(path, os.X_OK)
        assert path.read_text().startswith(f"#!{sys.executable}\n")


@pytest.mark.parametrize(("package", "name"), SCRIPTS)
def test_help_comes_at_once(help_of, package, name):
    done = help_of(package, name)
    assert done.returncode == 0, done.stderr
    usage, *lines = done.stdout.splitlines()
    assert usage.startswith(f"usage: ros2 run {package} {name}")
    assert [line for line in lines if len(line.rstrip()) > COLUMNS] == []
    assert done.modules & HEAVY == set()


@pytest.mark.parametrize(
    ("package", "name"),
    [("sain_sim", "sim_node"), ("sain_eval", "evaluate"), ("sain_bringup", "closed_loop")],
)
def test_an_unknown_argument_is_refused_at_once(start, package, name):
    """The text is tested for every command in one process, `test_command_line`."""
    done = start(package, name, "--wrold", "rough")
    assert done.returncode == 2, done.stderr
    assert "--wrold" in said(done.stderr)
    assert done.modules & HEAVY == set()


@pytest.mark.parametrize(("package", "name"), SCRIPTS)
def test_every_setting_has_a_text_with_its_values(help_of, package, name):
    command = entry(package, name)
    shown = said(help_of(package, name).stdout)
    if isinstance(command, NodeCommand):
        for parameter, default, allowed, meaning in describe_parameters(
            load(command.name, command.settings)()
        ):
            notes = "; ".join(filter(None, (allowed, f"default: {default}")))
            assert meaning and f"{parameter} {meaning} ({notes})" in shown
        return
    for item in settings_in(command.options()):
        text = item.metadata.get("description", "")
        assert text, f"{item.name} has no text"
        assert text[:1].upper() + text[1:] in shown
        assert (item.metadata.get("unit") or "") in shown
        for choice in item.metadata.get("choices") or ():
            assert str(choice) in shown


def settings_in(options: type) -> list[Any]:
    """The fields of a class of settings and of those nested in it."""
    found, hints = [], get_type_hints(options)
    for item in filter(lambda one: one.init, fields(options)):
        kind = hints[item.name]
        found += settings_in(kind) if isinstance(kind, type) and is_dataclass(kind) else [item]
    return found


def test_a_node_says_how_parameters_are_given(start):
    done = start("sain_sim", "sim_node", "--world", "rough")
    assert said(done.stderr) == (
        "sim_node: unknown argument '--world'; allowed are --help and --ros-args. Parameters are"
        " given as --ros-args -p world:=rough"
    )


@pytest.mark.parametrize(
    ("package", "name", "arguments", "message"),
    [
        ("sain_eval", "evaluate", ["--scenes", "0"], "--scenes is 0; it must be at least 1"),
        ("sain_eval", "evaluate", ["--planner.samples", "0"], "--planner.samples is 0; it must be at least"),
        ("sain_model", "train", ["data", "--out", "o", "--batch", "0"], "--batch is 0; it must be"),
        ("sain_sim", "collect", ["--world", "ruff"], "randomised"),
        ("sain_bringup", "closed_loop", ["--scenario", "papper"], "did you mean 'paper'?"),
        ("sain_bringup", "closed_loop", ["--seed", "-1"], "--seed is -1; it must be at least 0"),
    ],
)  # fmt: skip
def test_a_wrong_value_is_named_before_anything_is_imported(
    start, package, name, arguments, message
):
    done = start(package, name, *arguments)
    assert done.returncode == 2
    assert message in said(done.stderr)
    assert done.modules & HEAVY == set()


@pytest.mark.parametrize(
    ("package", "name", "arguments", "module"),
    [
        ("sain_sim", "sim_node", [], "rclpy"),
        ("sain_sim", "sim_node", ["--ros-args"], "pybullet"),
        ("sain_model", "model_node", [], "numba"),
        ("sain_model", "train", ["data", "--out", "none"], "torch"),
        ("sain_eval", "evaluate", ["--controllers", "sain"], "numba"),
        ("sain_bags", "info", ["none"], "rich"),
    ],
)
def test_ctrl_c_during_an_import_ends_it_quietly(
    ros_domain, tmp_path, package, name, arguments, module
):
    entry = ENTRY.format(package=package, name=name)
    code = INTERRUPT.format(module=module, arguments=[name, *arguments], start=entry)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    left = [path for path in tmp_path.rglob("*") if path.is_file() and path.name not in KEPT]
    assert left == []


def test_ctrl_c_before_the_command_is_there_ends_it_quietly(tmp_path):
    launcher = LAUNCHER.format(path=executable("sain_eval", "evaluate"))
    code = INTERRUPT.format(module="sain_core", arguments=["evaluate"], start=launcher)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=100
    )
    assert (done.returncode, done.stderr) == (130, "")
