"""Bags of other people's robots become data sets: poses of a body and of a tool are pushes."""

from pathlib import Path

import numpy as np
import pytest
from rosbags.convert.converter import convert
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from sain_core.errors import DatasetError
from sain_core.scene import wrap_angle
from sain_model.importing.files import read_recordings
from sain_model.importing.pose_bags import PoseTopics
from tests.sain_model.importing.recorded import TIP, Recorded, simulate, write_stated

STORE = get_typestore(Stores.ROS1_NOETIC)
TRANSFORMS = "geometry_msgs/TransformStamped[] transforms"
STORE.register(get_types_from_msg(TRANSFORMS, "tf2_msgs/msg/TFMessage"))
TOPICS = PoseTopics("/tf:knee", "/arm/tip", "knee", "steel")
RATE = 100  # [1/s], of poses
UP = 0.1  # [m], where the tool goes to its next start, straight and level
EVERY = dict.fromkeys(
    ("exclude_topics", "include_topics", "exclude_msgtypes", "include_msgtypes"), ()
)
AWAY = np.array([0.3, 0.0, 1.0])  # where a hand takes the body


@pytest.fixture(scope="module")
def rows(tmp_path_factory) -> Recorded:
    recorded = simulate(tmp_path_factory.mktemp("simulated"))
    knee = recorded.object == "knee"
    return Recorded(**{name: column[knee] for name, column in vars(recorded).items()})


def make(kind: str, **fields):
    return STORE.types[kind](**fields)


def pose(x: float, y: float, z: float, heading: float, moved: str = "pose") -> dict:
    """Return a pose or a transform, by the name of the field that it is in."""
    names = ("Pose", "Point", "position", "orientation")
    if moved == "transform":
        names = ("Transform", "Vector3", "translation", "rotation")
    kind, place, at, turn = names
    quaternion = {"x": 0.0, "y": 0.0, "z": np.sin(heading / 2), "w": np.cos(heading / 2)}
    return {
        moved: make(
            f"geometry_msgs/msg/{kind}",
            **{at: make(f"geometry_msgs/msg/{place}", x=x, y=y, z=z)},
            **{turn: make("geometry_msgs/msg/Quaternion", **quaternion)},
        )
    }


def header(frame: str):
    stamp = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    return make("std_msgs/msg/Header", seq=0, stamp=stamp, frame_id=frame)


def write_bag(
    path: Path,
    rows: Recorded,
    noise: float = 0.0,
    base: str = "world",
    spoilt: int = 0,
    back: float = 0.0,
    rests: bool = False,
) -> Path:
    """Write a bag of ROS 1: the tool stands, pushes, stands, and goes to its next start above.

    While it stands after a push, a hand takes the body away. Poses of the tool are in a frame
    `base`, with noise [m]. One in `spoilt` poses of the body has no quaternion. After a push the
    tool goes back by a share of it, and `rests` before and after, or not.
    """
    now, kinds = (
        1_500_000_000_000_000_000,
        ("tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseStamped"),
    )
    random = np.random.default_rng(0)
    with Writer(path) as writer:
        tf, tip = (
            writer.add_connection(topic, kind, typestore=STORE)
            for topic, kind in zip(("/tf", "/arm/tip"), kinds, strict=True)
        )

        def at(body: np.ndarray, tool: np.ndarray, height: float = 0.0) -> None:
            nonlocal now
            now += 10**9 // RATE
            tool = tool + random.normal(scale=noise, size=2) if noise else tool
            moved = pose(*body[:2].tolist(), 0.02, float(body[2]), "transform")
            if spoilt and now // (10**9 // RATE) % spoilt == 0:
                moved["transform"].rotation.z = moved["transform"].rotation.w = 0.0
            other = pose(9.0, 9.0, 0.0, 0.0, "transform")
            stamped = [
                make("geometry_msgs/msg/TransformStamped", header=header("world"),
                     child_frame_id=frame, **one)
                for frame, one in (("knee", moved), ("camera", other))
            ]  # fmt: skip
            tool_pose = make(kinds[1], header=header(base), **pose(*tool.tolist(), height, 0.0))
            writer.write(
                tf, now, STORE.serialize_ros1(make(kinds[0], transforms=stamped), kinds[0])
            )
            writer.write(tip, now, STORE.serialize_ros1(tool_pose, kinds[1]))

        last = rows.tip_start[0]
        for before, after, start, end, speed in zip(
            rows.before, rows.after, rows.tip_start, rows.tip_end, rows.speed, strict=True
        ):
            way = np.linspace(0.0, 1.0, RATE)
            for share in (*np.zeros(RATE // 2), *way, *np.ones(RATE // 2)):
                at(before, last + share * (start - last), UP)
            ways = np.linspace(0.0, 1.0, round(RATE * float(np.linalg.norm(end - start) / speed)))
            rest = np.ones(RATE // 2) if rests or not back else np.zeros(0)
            for share in (*np.zeros(RATE // 2), *ways, *rest):
                at(before + share * (after - before), start + share * (end - start))
            for share in np.linspace(0.0, back, 20 * bool(back)):
                at(after, end - share * (end - start))
            last = end - back * (end - start)
            for _ in range(RATE // 2 * rests):
                at(after, last)
            for _ in range(RATE // 2):
                at(after + AWAY, last)
    return path


def test_poses_in_a_bag_of_ros_1_are_the_pushes(rows, tmp_path):
    shapes = write_stated(tmp_path)
    bag = write_bag(tmp_path / "mine.bag", rows)
    found = read_recordings([bag], shapes, TIP, topics=TOPICS)
    pushes = found.pushes
    assert len(pushes) == len(rows) and set(pushes.run.tolist()) == {"mine"}
    (note,) = found.notes
    assert note.endswith(" ways of the tool are no pushes")
    for name in ("before", "after", "tip_start", "tip_end"):
        off = getattr(pushes, name) - getattr(rows, name)
        off[:, 2:] = wrap_angle(off[:, 2:])
        np.testing.assert_allclose(off, 0.0, atol=3e-5)
    np.testing.assert_allclose(pushes.speed, rows.speed, rtol=0.03)


def test_noise_and_a_few_spoilt_poses_lose_no_push(rows, tmp_path):
    bag = write_bag(tmp_path / "mine.bag", rows, noise=1e-4, spoilt=50)
    topics = PoseTopics("/tf:/knee", "/arm/tip", "knee")
    found = read_recordings([bag], write_stated(tmp_path), TIP, topics=topics)
    assert len(found.pushes) == len(rows)
    assert "poses are left out: /tf:/knee has a quaternion of length 0" in found.notes[0]
    np.testing.assert_allclose(found.pushes.tip_end, rows.tip_end, atol=1e-3)


def test_a_way_there_and_back_is_no_push(rows, tmp_path):
    bag = write_bag(tmp_path / "mine.bag", rows, back=0.4)
    with pytest.raises(DatasetError, match="holds no push"):
        read_recordings([bag], write_stated(tmp_path), TIP, topics=TOPICS)


def test_a_way_back_after_a_rest_is_no_push(rows, tmp_path):
    bag = write_bag(tmp_path / "mine.bag", rows, back=0.6, rests=True)
    found = read_recordings([bag], write_stated(tmp_path), TIP, topics=TOPICS)
    np.testing.assert_allclose(found.pushes.tip_end, rows.tip_end, atol=3e-5)


def test_poses_of_two_frames_are_an_error(rows, tmp_path):
    bag = write_bag(tmp_path / "mine.bag", rows, base="camera")
    with pytest.raises(DatasetError, match="is in frame 'world', and /arm/tip in 'camera'"):
        read_recordings([bag], write_stated(tmp_path), TIP, topics=TOPICS)


def test_a_folder_of_ros_2_is_one_bag(rows, tmp_path):
    """As ROS 2 wrote them up to Humble: with a database."""
    old, new = write_bag(tmp_path / "mine.bag", rows), tmp_path / "mine"
    plain = {"compress": None, "compress_mode": "file", "default_typestore": None}
    store = get_typestore(Stores.ROS2_JAZZY)
    convert([old], new, "sqlite3", 8, **plain, typestore=store, **EVERY)
    assert [one.suffix for one in sorted(new.iterdir())] == [".yaml", ".db3"]
    found = read_recordings([new], write_stated(tmp_path), TIP, topics=TOPICS)
    assert len(found.pushes) == len(rows) and found.paths == (new,)


@pytest.mark.parametrize(
    ("topics", "text"),
    [
        (None, "mine.bag is a bag; give --body-topic, --tool-topic and --body"),
        (
            PoseTopics("/vicon", "/arm/tip", "knee"),
            r"no topic /vicon with messages; give one of /arm/tip \(geometry_msgs",
        ),
        (PoseTopics("/tf:cup", "/arm/tip", "knee"), "no poses of 'cup' on /tf"),
        (PoseTopics("/tf:knee", "/tf:camera", "knee"), "holds no push: none of 0 ways"),
    ],
)
def test_a_bag_that_has_no_pushes_says_what_it_needs(rows, tmp_path, topics, text):
    bag = write_bag(tmp_path / "mine.bag", rows)
    with pytest.raises(DatasetError, match=text):
        read_recordings([bag], write_stated(tmp_path), TIP, topics=topics)


def write_few(path: Path, *poses: tuple[str, str, str]) -> Path:
    """Write a bag of poses, each with its topic, its frame, and the frame that it is of."""
    kinds = {"/tf": "tf2_msgs/msg/TFMessage"}
    with Writer(path) as writer:
        topics = {
            topic: writer.add_connection(
                topic, kinds.get(topic, "geometry_msgs/msg/PoseStamped"), typestore=STORE
            )
            for topic in dict.fromkeys(topic for topic, *_ in poses)
        }
        for now, (topic, frame, child) in enumerate(poses):
            kind = topics[topic].msgtype
            if topic in kinds:
                moved = pose(0.5, 0.0, 0.0, 0.0, "transform")
                one = "geometry_msgs/msg/TransformStamped"
                stamped = make(one, header=header(frame), child_frame_id=child, **moved)
                message = make(kind, transforms=[stamped])
            else:
                message = make(kind, header=header(frame), **pose(0.5, 0.0, 0.0, 0.0))
            writer.write(topics[topic], now, STORE.serialize_ros1(message, kind))
    return path


KNEE, MAPPED, CAMERA, TOOL, OTHER = (
    ("/tf", "world", "knee"),
    ("/tf", "map", "knee"),
    ("/tf", "world", "camera"),
    ("/arm/tip", "world", ""),
    ("/arm/tip", "map", ""),
)


@pytest.mark.parametrize(
    ("poses", "body", "tool", "text"),
    [
        (
            (KNEE, KNEE, MAPPED, CAMERA, TOOL),
            "/tf:knee",
            "/arm/tip",
            "/tf:knee has poses in several frames: 2 in 'world', 1 in 'map'; allowed: one. Record"
            " it again with one publisher of these poses, or",
        ),
        (
            (KNEE, TOOL, OTHER),
            "/tf",
            "/arm/tip",
            "/arm/tip has poses in several frames: 1 in 'world', 1 in 'map'; allowed: one",
        ),
        (
            (KNEE, MAPPED, CAMERA, TOOL),
            "/tf",
            "/arm/tip",
            "/tf has poses of camera, knee; name one frame: /tf:FRAME",
        ),
        (
            (KNEE, ("/left/tip", "world", ""), ("/right/tip", "world", "")),
            "/tf",
            "tip",
            "has no topic tip with messages; give one of /left/tip"
            " (geometry_msgs/msg/PoseStamped), /right/tip (geometry_msgs/msg/PoseStamped), /tf",
        ),
        (
            (KNEE, TOOL),
            "/tf",
            "/arm/tip:tip",
            "has no poses of 'tip' on /arm/tip; they name no frame: give /arm/tip alone",
        ),
    ],
)
def test_frames_and_topics_that_are_not_one_are_named(tmp_path, poses, body, tool, text):
    bag = write_few(tmp_path / "mine.bag", *poses)
    with pytest.raises(DatasetError) as raised:
        read_recordings([bag], write_stated(tmp_path), TIP, topics=PoseTopics(body, tool, "knee"))
    assert str(raised.value).startswith(str(bag)) and text in str(raised.value)


def test_a_damaged_bag_is_an_error(rows, tmp_path):
    bag = write_bag(tmp_path / "mine.bag", rows)
    whole = bag.read_bytes()
    for content in (b"", b"#ROSBAG V2.0\n", whole[: len(whole) // 2], whole[:5000] + b"x" * 5000):
        bag.write_bytes(content)
        with pytest.raises(DatasetError, match=r"mine\.bag"):
            read_recordings([bag], write_stated(tmp_path), TIP, topics=TOPICS)
