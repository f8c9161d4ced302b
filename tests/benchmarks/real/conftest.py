"""Pushes in the form of real ones, made once for all tests of the page."""

import pytest

from benchmarks.real.pushes import push_table
from tests.benchmarks.real.synthetic import write_pushes


@pytest.fixture(scope="session")
def synthetic_pushes(tmp_path_factory):
    return push_table(write_pushes(tmp_path_factory.mktemp("pushes"), count=66))
