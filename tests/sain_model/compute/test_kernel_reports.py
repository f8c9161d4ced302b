"""What a person reads while kernels are compiled."""

from io import StringIO

import pytest
from rich.console import Console

from sain_model.compute import kernel_store
from sain_model.compute.kernel_store import compile_visibly, describe_compilation


def test_it_says_how_many_of_how_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_store, "kernels_are_ready", lambda: False)
    monkeypatch.setattr(kernel_store, "compile_kernels", lambda report: report(31, 40))
    console = Console(file=StringIO(), width=60)
    compile_visibly(console)
    assert isinstance(console.file, StringIO)
    assert console.file.getvalue() == "compiling 31 of 40 kernels\n"


def test_by_default_it_says_so_on_standard_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(kernel_store, "kernels_are_ready", lambda: False)
    monkeypatch.setattr(kernel_store, "compile_kernels", lambda report: report(31, 40))
    compile_visibly()
    assert capsys.readouterr() == ("", "compiling 31 of 40 kernels\n")
    monkeypatch.setattr(kernel_store, "kernels_are_ready", lambda: True)
    compile_visibly()
    assert capsys.readouterr() == ("", "")


def test_who_waits_is_told_what_another_process_compiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernel_store, "compilation_progress", lambda: (31, 40))
    assert describe_compilation() == "compiling 31 of 40 kernels"
    monkeypatch.setattr(kernel_store, "compilation_progress", lambda: None)
    assert describe_compilation() == ""
