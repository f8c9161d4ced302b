"""Poses of bodies from pictures of their tags: exact, lawful, and nothing where it is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from sain_core.scene import wrap_angle
from sain_core.shapes.body_file import Tag
from sain_vision.detection.sighting import Sighting
from sain_vision.detection.tags import TagConfig, TagFinder, TagLocator
from sain_vision.optics import CameraModel
from tests.sain_vision.pictures import CAMERA, file_of, take

UNBIASED = {"place_bias": 0.0, "turn_bias": 0.0, "corner_noise": 0.03}
LENS = np.array([-0.1, 0.03, 0.001, -0.001, 0.0])
POSES = np.array([(0.35, -0.2, 0.3), (0.45, 0.0, 2.0), (0.55, 0.25, -2.5), (0.4, 0.3, 1.2)])
ONE_EACH = file_of(*((Tag(n),) for n in range(len(POSES))))


def locate(
    picture: np.ndarray, file=ONE_EACH, camera: CameraModel = CAMERA, **config: float
) -> tuple[dict[int, Sighting], list[str]]:
    settings = TagConfig(**config)
    found = TagFinder(settings).find(picture)
    sightings, problems = TagLocator(file, settings).locate(found, camera)
    return {one.body: one for one in sightings}, problems


def off(found: dict[int, Sighting], poses: np.ndarray) -> np.ndarray:
    errors = np.stack([found[n].pose for n in range(len(poses))]) - poses
    errors[:, 2] = wrap_angle(errors[:, 2])
    return errors


@pytest.fixture(scope="module")
def picture() -> np.ndarray:
    return take(CAMERA, enumerate(POSES), np.random.default_rng(0))


@pytest.mark.parametrize("lens", [np.zeros(5), LENS], ids=["ideal", "distorted"])
def test_poses_are_exact_and_their_covariance_is_of_that_size(lens: np.ndarray) -> None:
    camera, errors, scaled = replace(CAMERA, distortion=lens), [], []
    for seed in range(4):
        random = np.random.default_rng(seed)
        poses = POSES + random.uniform(-0.03, 0.03, POSES.shape)
        picture = take(camera, enumerate(poses), random)
        found, problems = locate(picture, camera=camera, **UNBIASED)
        assert not problems
        errors.append(off(found, poses))
        covariances = [found[n].covariance for n in range(len(poses))]
        scaled += [e @ np.linalg.solve(c, e) for e, c in zip(errors[-1], covariances, strict=True)]
    every = np.abs(np.concatenate(errors))
    assert np.hypot(every[:, 0], every[:, 1]).max() < 0.0003
    assert every[:, 2].max() < np.radians(0.3)
    assert 0.3 < np.mean(scaled) / 3 < 3.0


def test_what_is_moved_and_turned_is_seen_moved_and_turned(picture: np.ndarray) -> None:
    """A turn of all bodies about the camera's foot, and of the camera, changes no image."""
    angle, way = 0.7, np.array([0.2, -0.1])
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1.0]])
    camera = CAMERA.moved(turn @ CAMERA.rotation, turn @ CAMERA.place + (*way, 0.0))
    before, after = locate(picture)[0], locate(picture, camera=camera)[0]
    for body, one in before.items():
        other = after[body]
        np.testing.assert_allclose(other.pose[:2], turn[:2, :2] @ one.pose[:2] + way, atol=1e-9)
        assert wrap_angle(other.pose[2] - one.pose[2] - angle) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(other.covariance, turn @ one.covariance @ turn.T, atol=1e-9)


def test_several_tags_are_one_body_and_some_of_them_suffice() -> None:
    tags = (Tag(5, x=-0.04), Tag(6, x=0.04, angle=1.0), Tag(7, y=0.05))
    body, pose = file_of(tags), np.array([0.45, 0.05, 0.6])
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cosine, -sine], [sine, cosine]])
    placed = [
        (t.number, np.array([*(pose[:2] + turn @ (t.x, t.y)), pose[2] + t.angle])) for t in tags
    ]
    whole, part = (
        locate(take(CAMERA, shown, np.random.default_rng(3)), body)[0][0]
        for shown in (placed, placed[:1])
    )
    assert (whole.score, part.score) == (1.0, pytest.approx(1 / 3))
    for seen in (whole, part):
        assert np.hypot(*(seen.pose - pose)[:2]) < 0.0015
    assert whole.covariance[2, 2] < part.covariance[2, 2] / 2


@pytest.mark.parametrize(
    ("file", "shown", "camera", "text"),
    [
        (ONE_EACH, [(1, POSES[0]), (1, POSES[1])], CAMERA, "tag 1 of body 1 (body_1) is seen 2"),
        (file_of((Tag(0, size=0.06),)), [(0, POSES[0])], CAMERA, "check size, place and height"),
        (
            ONE_EACH,
            [(0, POSES[0])],
            replace(CAMERA, rotation=CAMERA.rotation @ np.diag([1.0, -1.0, -1.0])),
            "does not look down onto the table",
        ),
    ],
    ids=["twice", "size", "camera"],
)  # fmt: skip
def test_what_is_wrong_is_named_and_not_published(file, shown, camera, text) -> None:
    found, problems = locate(take(CAMERA, shown, np.random.default_rng(0)), file, camera)
    assert not found
    assert len(problems) == 1 and text in problems[0]


def test_tags_that_nobody_has_are_nobody(picture: np.ndarray) -> None:
    found, problems = locate(picture, file_of((Tag(77),)))
    assert (found, problems) == ({}, [])
