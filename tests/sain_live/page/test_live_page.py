"""The page, without a graph and without a browser."""

from http.client import HTTPConnection

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

from sain_core.push import make_push
from sain_core.world import PushRecord
from sain_live.page.serving import refusal
from sain_live.requests import Follow, LoadModel, Pause, Reset, SetGoal, SetParameter
from sain_live.state import Level, LivePlan
from tests.sain_live.straw import AIM, SCENE, Requests, made_up, served
from tests.sain_live.viewer import Viewer

GOAL = "/goals/0"


@pytest.fixture
def shown():
    state, requests = made_up(), Requests()
    with served(state, requests.append) as page:
        viewer = Viewer(page.server.get_port())
        viewer.wait(lambda: GOAL in viewer.nodes and page.viewers == 1, "the page")
        yield state, requests, page, viewer
        viewer.close()


def test_a_dragged_goal_is_an_order(shown):
    state, requests, _, viewer = shown
    viewer.drag(GOAL, (0.45, 0.1), (0.4, -0.1))
    viewer.wait(lambda: requests.of(SetGoal), "the order")
    (request,) = requests.of(SetGoal)
    aim = request.goal
    assert (aim.poses[0].x, aim.poses[0].y) == (0.4, -0.1)
    assert aim.poses[0].heading == pytest.approx(0.5)
    assert state.aim is aim


@pytest.mark.parametrize(
    ("place", "words"),
    [((0.5, 0.9), "off the table"), ((0.6, -0.2), "overlaps fixed body 1"), ((0.5, np.nan), "nan")],
)
def test_a_goal_where_none_can_be_snaps_back_and_is_told(shown, place, words):
    state, requests, _, viewer = shown
    viewer.drag(GOAL, place)
    viewer.wait(lambda: words in viewer.texts, "the words")
    viewer.wait(lambda: viewer.nodes[GOAL]["position"][:2] == (0.5, 0.2), "the goal to snap back")
    assert requests.of(SetGoal) == []
    assert state.aim is AIM


def test_settings_are_controls_and_orders(shown):
    state, requests, _, viewer = shown
    state.update(planner={"planner.horizon": 6, "planner.weights.position": [90.0, 90.0]})
    viewer.wait(lambda: viewer.controls[viewer.control("horizon")]["value"] == 6, "the value")
    assert requests.of(SetParameter) == []  # what the planner has is no order
    for label, value, name, expected in (
        ("horizon", 3, "planner.horizon", 3),
        ("thinning", 0.25, "planner.thinning", 0.25),
        ("algorithm", "mppi", "planner.algorithm", "mppi"),
        ("warm start", False, "planner.warm_start", False),
        ("position [1/m^2]", "[50, 60]", "planner.weights.position", [50.0, 60.0]),
    ):
        viewer.turn(label, value)
        wanted = SetParameter(name, expected)
        viewer.wait(lambda w=wanted: w in requests, f"the request for {name}")
    slider = viewer.controls[viewer.control("thinning")]
    assert (slider["min"], slider["max"]) == (0.01, 1.0)
    assert "one round to the next: 0.5 halves them (0.01 to 1)" in viewer.texts


def test_a_refused_setting_goes_back(shown):
    state, requests, _, viewer = shown
    state.update(planner={"planner.horizon": 6, "planner.weights.position": [90.0, 90.0]})
    position = viewer.control("position [1/m^2]")
    viewer.wait(lambda: viewer.controls[position]["value"] == "[90, 90]", "the planner's value")
    viewer.turn("position [1/m^2]", "many")
    viewer.wait(lambda: "it must be numbers" in viewer.texts, "the words")
    viewer.wait(lambda: viewer.controls[position]["value"] == "[90, 90]", "the value before")
    viewer.turn("horizon", 50)
    viewer.wait(lambda: requests.of(SetParameter), "the order")
    state.update(planner=dict(state.planner))  # as after the planner's refusal
    horizon = viewer.control("horizon")
    viewer.wait(lambda: viewer.controls[horizon]["value"] == 6, "the value before")


def test_buttons_are_orders(shown):
    _, requests, _, viewer = shown
    for name, request in (("Start", Follow()), ("One push", Follow(1)), ("Pause", Pause())):
        viewer.turn("loop", name)
        viewer.wait(lambda r=request: r in requests, f"the request {request}")
    viewer.turn("scenario", "rearrange_2")
    viewer.turn("seed", "5")
    viewer.wait(lambda: "Not started yet" in viewer.texts, "the hint")
    viewer.turn("Reset", True)
    viewer.wait(lambda: requests.of(Reset), "the reset")
    viewer.wait(lambda: "Not started yet" not in viewer.texts, "no hint any more")
    (reset,) = requests.of(Reset)
    assert (reset.case.scenario, reset.case.seed) == ("rearrange_2", 5)


def test_the_list_of_models_shows_the_one_that_is_served(shown):
    state, requests, _, viewer = shown
    shows = viewer.controls[viewer.control("model")]
    assert shows["value"] == "none yet"
    state.update(model="planar")
    viewer.wait(lambda: shows["value"] == "planar", "the model")
    assert requests.of(LoadModel) == []  # what is served is no order
    viewer.turn("model", "bullet")
    viewer.wait(lambda: requests.of(LoadModel) == [LoadModel("bullet")], "the order")
    state.update(loading="identity")  # another viewer's
    viewer.wait(lambda: shows["value"] == "identity", "the one on its way")
    state.update(loading="")  # as after a refusal
    viewer.wait(lambda: shows["value"] == "planar", "the one before")
    state.update(model="runs/mine/sain.safetensors")
    viewer.wait(lambda: shows["value"] == "runs/mine/sain.safetensors", "one that was not listed")


def test_texts_from_elsewhere_are_escaped(shown):
    state, _, _, viewer = shown
    state.tell(Level.FAULT, "<script>alert(1)</script>")
    viewer.wait(lambda: "alert" in viewer.texts, "the line")
    assert "<script>" not in viewer.texts


def test_plan_and_result_are_drawn_and_cleared(shown):
    state, _, _, viewer = shown
    after = np.stack([SCENE, SCENE])
    after[:, 0, 0] += 0.05
    ways = np.zeros((3, 2, 2, 2)) + 0.4
    pushes = make_push(0.0, 0.0, [0.1, 0.1])
    plan = LivePlan(7, SCENE, pushes, after, np.full((2, 2), 0.01), np.arange(3.0), ways)
    state.update(plan=plan, result=PushRecord(pushes[0], SCENE, SCENE, after[0]))
    names = ("other_paths", "planned_paths", "planned_bodies", "regions", "push")
    wanted = {*(f"/plan/{name}" for name in names), "/result/expected_bodies"}

    def drawn():
        nodes = list(viewer.nodes)
        return {one for one in wanted if any(node.startswith(one) for node in nodes)}

    viewer.wait(lambda: drawn() == wanted, "the plan")
    state.update(plan=None, result=None)
    viewer.wait(lambda: not drawn(), "an empty table")


def test_other_websites_are_kept_out(shown):
    _, _, page, _ = shown
    port = page.server.get_port()
    Viewer(port, origin=f"http://127.0.0.1:{port}").close()
    with pytest.raises(InvalidStatus, match="403"):
        Viewer(port, origin="http://example.org")


@pytest.mark.parametrize(
    ("host", "headers", "status", "words"),
    [
        ("127.0.0.1", {"Host": "127.0.0.1:8080"}, 200, ""),
        ("127.0.0.1", {"Host": "localhost:80", "Origin": "http://localhost:80"}, 200, ""),
        ("127.0.0.1", {"Host": "example.org:8080"}, 403, "open it as 127.0.0.1"),
        ("0.0.0.0", {"Host": "lab:8080", "Origin": "http://lab:8080"}, 200, ""),
        ("0.0.0.0", {"Host": "lab:8080", "Origin": "http://x.org"}, 403, "may not use"),
        ("0.0.0.0", {"Host": "lab:8080", "Origin": "http://a["}, 403, "may not use"),
        ("127.0.0.1", {"Host": "a["}, 400, "no address"),
    ],
)
def test_names_that_lead_here_from_elsewhere_are_refused(host, headers, status, words):
    assert (refusal(host, headers) or (200, ""))[0] == status
    assert words in (refusal(host, headers) or (200, ""))[1]


@pytest.mark.parametrize(
    ("hosts", "status", "words"),
    [(["127.0.0.1"], 200, "<html"), (["a["], 400, "no address"), (["a", "b"], 400, "no address")],
)
def test_no_other_website_may_frame_the_page(shown, hosts, status, words):
    request = HTTPConnection("127.0.0.1", shown[2].server.get_port(), timeout=20)
    request.putrequest("GET", "/", skip_host=True)
    for host in hosts:
        request.putheader("Host", host)
    request.endheaders()
    reply = request.getresponse()
    text = reply.read().decode()
    request.close()
    assert (reply.status, reply.headers["X-Frame-Options"]) == (status, "DENY")
    assert reply.headers["Content-Security-Policy"] == "frame-ancestors 'none'"
    assert words in text
    assert status == 200 or text.count("\n") == 1


def test_nonsense_from_a_viewer_changes_nothing(shown):
    state, requests, _, viewer = shown
    for position in ("there", (), (1e308, -1e308, 0.0)):
        viewer.send(
            "TransformControlsUpdateMessage", name=GOAL, position=position, wxyz=(1, 0, 0, 0)
        )
        viewer.send("TransformControlsDragEndMessage", name=GOAL)
    viewer.wait(lambda: viewer.texts.count("goal of body 0") >= 2, "the words")
    viewer.drag(GOAL, (0.4, -0.1))
    viewer.wait(lambda: requests.of(SetGoal), "the order")
    assert state.aim.poses[0].x == 0.4
