"""Graphs of other tests on this computer are not seen: what is said where nobody is names them."""

import pytest

import sain_bringup.ros.listener
import sain_core.guarding.ros.ownership


@pytest.fixture(autouse=True)
def locks(tmp_path, monkeypatch):
    """Keep locks apart from those of other graphs on this computer."""
    for module in (sain_bringup.ros.listener, sain_core.guarding.ros.ownership):
        monkeypatch.setattr(module, "private_folder", lambda: tmp_path)
    monkeypatch.setattr(sain_bringup.ros.listener, "ABSENT", 0.5)
    monkeypatch.setattr(sain_bringup.ros.listener, "SILENT", 1.0)
