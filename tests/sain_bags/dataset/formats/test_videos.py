"""Images of a bag become videos of a LeRobot data set: of each push the last before it was sent."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from sain_bags.dataset.conversion import convert
from sain_bags.dataset.dataset_folder import CARD_FILE, IDENTITY_FILE
from sain_bags.dataset.rows import UNSEEN, ConversionConfig
from sain_core.errors import DatasetError, OutputError
from sain_core.output import MANIFEST
from sain_model.data.dataset import load_dataset
from tests.sain_bags.conftest import SECOND
from tests.sain_bags.dataset.formats.exported import card_of, to
from tests.sain_bags.driven import Drive

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
COLOUR, DEPTH = "/sain/camera/color/image_raw", "/sain/camera/depth/image_raw"
KEY = "observation.images.camera_color"
LOSS = 4.0  # mean difference of a pixel that the codec may make, of 255


def picture(number: int, height: int = 96, width: int = 128) -> Any:
    """Return an image (height, width, 3) that tells which it is."""
    pixels = np.full((height, width, 3), 40, dtype=np.uint8)
    pixels[:, : width // 2] = np.random.default_rng(number).integers(0, 255, 3)
    return pixels


class Filmed(Drive):
    """Sends an image before each push, and one that shows something else after it."""

    taken = 0
    shape = (96, 128)
    unseen: tuple[int, ...] = ()  # pushes before which the camera fails

    def push(self, episode: int, push_id: int, before: Any, place: int) -> Any:
        if push_id in self.unseen:
            self.recording.now += 2 * SECOND
        else:
            self.film(self.taken)
            self.taken += 1
        after = super().push(episode, push_id, before, place)
        self.film(1000 + self.taken)
        return after

    def film(self, number: int) -> None:
        pixels = picture(number, *self.shape)
        height, width, _ = pixels.shape
        about = {"height": height, "width": width, "encoding": "bgr8", "step": 3 * width}
        data = pixels[..., ::-1].ravel()
        self.recording.add(COLOUR, RAW, **about, data=data)
        depth = about | {"encoding": "16UC1", "step": 2 * width}
        self.recording.add(DEPTH, RAW, **depth, data=data[: 2 * height * width])


def filmed(record: Callable[..., Any], name: str = "bag", kind: type = Filmed, **more: Any) -> Path:
    recording = record(name)
    driver = kind(recording, seed=len(name))
    for key, value in more.items():
        setattr(driver, key, value)
    for episode in (1, 2, 3, 4):
        driver.episode(episode, range(10 * episode, 10 * episode + 3))
    recording.writer.close()
    return Path(recording.writer.folder)


def test_each_frame_shows_the_last_image_before_the_push(record: Any, tmp_path: Path) -> None:
    from sain_bags.dataset.formats.to_lerobot import LeRobotDataset

    bag = filmed(record, unseen=(21,))
    out = to("lerobot", bag, tmp_path / "out")
    data = LeRobotDataset("filmed", root=out, video_backend="pyav")
    sent = [push for push in range(50) if push // 10 in (1, 2, 3, 4) and push % 10 < 3]
    image_of = {push: n for n, push in enumerate(push for push in sent if push != 21)}
    assert data.meta.video_keys == [KEY]
    assert data.num_frames == len(image_of) == 11
    for frame in map(data.__getitem__, range(data.num_frames)):
        seen = 255 * frame[KEY].numpy().transpose(1, 2, 0)
        wanted = picture(image_of[int(frame["push_id"])])
        assert np.abs(seen - wanted).mean() < LOSS
    assert card_of(out)["dropped"][UNSEEN]["pushes"] == 1
    assert data.features[KEY]["info"]["video.codec"] == "av1"
    shades = np.stack([picture(n) for n in range(11)]) / 255
    stats = json.loads((out / "meta/stats.json").read_text())[KEY]
    np.testing.assert_allclose(np.ravel(stats["mean"]), shades.mean(axis=(0, 1, 2)), atol=0.01)
    assert stats["count"] == [11]
    plain = tmp_path / "plain"
    convert([bag], plain, ConversionConfig(format="lerobot", images=""))
    assert LeRobotDataset("plain", root=plain).num_frames == 12


def test_numbers_are_those_without_images_and_a_stop_changes_no_byte(
    record: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from sain_bags.dataset.formats import videos

    bag = filmed(record, "other")
    whole = to("lerobot", bag, tmp_path / "whole")
    add, calls = videos.Videos.add, []

    def stop(self: Any, *about: Any) -> None:
        calls.append(about)
        if len(calls) == 3:
            raise KeyboardInterrupt
        add(self, *about)

    monkeypatch.setattr(videos.Videos, "add", stop)
    with pytest.raises(KeyboardInterrupt):
        to("lerobot", bag, tmp_path / "out")
    again = to("lerobot", bag, tmp_path / "out")
    for file in filter(Path.is_file, whole.rglob("*.[mp]*")):
        assert (again / file.relative_to(whole)).read_bytes() == file.read_bytes(), file


class Compressed(Filmed):
    """A camera whose driver sends PNG."""

    def film(self, number: int) -> None:
        file = io.BytesIO()
        PIL.Image.fromarray(picture(number)).save(file, "PNG")
        data = np.frombuffer(file.getvalue(), np.uint8)
        self.recording.add(f"{COLOUR}/compressed", COMPRESSED, format="png", data=data)


def test_compressed_images_are_the_same_videos(record: Any, tmp_path: Path) -> None:
    raw, png = (
        to("lerobot", filmed(record, name, kind), tmp_path / kind.__name__)
        for name, kind in (("bag", Filmed), ("gab", Compressed))
    )
    (one,), (other,) = ([*out.glob(f"videos/{KEY}/*/*.mp4")] for out in (raw, png))
    assert one.read_bytes() == other.read_bytes()


def test_images_that_no_video_can_have_are_named(record: Any, tmp_path: Path) -> None:
    odd = filmed(record, "odd", shape=(97, 128))
    with pytest.raises(DatasetError, match=f"{KEY} has images of 128 x 97 px; AV1 takes even"):
        to("lerobot", odd, tmp_path / "out")
    small, large = filmed(record, "small"), filmed(record, "large", shape=(192, 128))
    with pytest.raises(DatasetError, match="128 x 96 and of 128 x 192 px; all must have one size"):
        to("lerobot", [small, large], tmp_path / "out")
    blind = filmed(record, "blind", Drive)
    with pytest.raises(DatasetError, match=f"small has {KEY}, .*blind has no images"):
        to("lerobot", [small, blind], tmp_path / "out")
    assert to("npz", [small, blind], tmp_path / "npz")
    for names in ("image_raw, image_color", "/sain/camera/color/other"):
        named = ConversionConfig(format="lerobot", images=names)
        has = f"has no images that end in /.*; it has {COLOUR}, {DEPTH}"
        with pytest.raises(DatasetError, match=has):
            convert([small], tmp_path / "named", named)
    whole = ConversionConfig(format="lerobot", images=COLOUR)
    convert([small], tmp_path / "named", whole)
    assert [*(tmp_path / "named").glob(f"videos/{KEY}/*/*.mp4")]


def test_a_video_that_is_missing_is_made_again_and_no_other_file_is_touched(
    record: Any, tmp_path: Path
) -> None:
    bag, out = filmed(record), tmp_path / "out"
    (video,) = to("lerobot", bag, out).glob(f"videos/{KEY}/*/*.mp4")
    whole = video.read_bytes()
    video.unlink()
    to("lerobot", bag, out)
    assert video.read_bytes() == whole
    video.write_bytes(whole[:100])
    with pytest.raises(OutputError, match=r"file-000.mp4 was changed since SAIN wrote it"):
        to("lerobot", bag, out)
    for name in (CARD_FILE, IDENTITY_FILE, MANIFEST):
        (out / name).unlink()
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    with pytest.raises(OutputError, match=r"no conversion\.json says that a conversion made them"):
        to("lerobot", bag, out)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    with pytest.raises(DatasetError, match="it is in LeRobot's format"):
        load_dataset(out)
