"""The package of `examples/my_model`, installed as its README says, is found by every command."""

import json
import subprocess
import sys

import pytest

from sain_bringup.graph import executable
from sain_core.errors import SainError
from sain_core.model import load_dynamics
from tests.examples.installing import install, run
from tests.sain_model.rolling import make_episodes


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The variables of processes for which the package is installed, and for no others."""
    return install("my_model", tmp_path_factory.mktemp("model"))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return make_episodes(tmp_path_factory.mktemp("data"))


def test_the_loop_plans_with_it(environment, tmp_path):
    arguments = ["--controllers", "my_model", "--scenes", 1, "--scenario", "paper"]
    arguments += ["--planner.samples", 128, "--out", tmp_path / "results"]
    run(environment, [str(executable("sain_eval", "evaluate"))], *arguments)
    (report,) = (tmp_path / "results").glob("*.json")
    assert "my_model" in report.read_text()


def test_a_network_learns_on_top_of_it_and_is_loaded_again(environment, dataset, tmp_path):
    out = tmp_path / "runs"
    arguments = ["--prior", "my_model", "--epochs", 1, "--hidden", 8, "--layers", 1, "--out", out]
    run(environment, [str(executable("sain_model", "train"))], dataset, *arguments)
    card = json.loads((out / "sain.json").read_text())
    assert (card["prior"], card["prior_config"], card["kind"]) == ("my_model", {}, "residual")
    lines = (
        "import sys; from sain_core.model import load_dynamics;"
        " from sain_core.conformance import check_dynamics;"
        " sain = load_dynamics(sys.argv[1]);"
        " print(type(sain.physics).__name__); check_dynamics(sain)"
    )
    checkpoint = str(out / "sain.safetensors")
    command = [sys.executable, "-c", lines, checkpoint]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "MyModel", done.stderr
    with pytest.raises(SainError, match=f"{out}/sain.json: model 'my_model' is unknown"):
        load_dynamics(checkpoint)  # here, where it is not installed


def test_predictions_are_compared_with_its(environment, dataset, tmp_path):
    out = tmp_path / "errors.json"
    arguments = ["--beside", "my_model", "--open-loop", 1, "--out", out]
    run(environment, [str(executable("sain_model", "evaluate"))], dataset, *arguments)
    rows = json.loads(out.read_text())["after"]["1"]["errors"]["pushed"]
    assert 0.0 < rows["my_model"]["mm"][0] < 0.5 * rows["no motion"]["mm"][0]


def test_it_is_served_without_loading_pytorch(environment):
    lines = (
        "import sys; from sain_model.serving.server import load_server;"
        " from sain_model.serving.service import ServingConfig;"
        " described = load_server(ServingConfig(model='my_model')).origin;"
        " print(described.prior_name, described.kind, 'torch' in sys.modules)"
    )
    command = [sys.executable, "-c", lines]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["my_model", "physics", "False"], done.stderr
