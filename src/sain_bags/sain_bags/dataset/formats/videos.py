"""Videos of a LeRobot data set: AV1, as `lerobot` encodes by default.

`lerobot` itself writes each image as PNG, begins an encoder for each episode and copies the file
with each; for live recordings it drops the images for which its encoder is late. Here all episodes
of a file pass through one encoder, and none is dropped.
"""

import os
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

os.environ.setdefault("SVT_LOG", "1")  # errors only; read when an encoder begins

import av
import numpy as np
from numpy import ndarray

from sain_core.errors import DatasetError

CODEC: Final = "libsvtav1"
OPTIONS: Final = {"g": "2", "crf": "30", "preset": "12"}  # `encode_video_frames` of lerobot 0.4.4
LEAST_SIDE: Final = 64  # [px], of the encoder; sides must be even
THUMBNAIL: Final = 150  # [px], about the longer side of what statistics are taken of, as by lerobot

Statistics = dict[str, ndarray]


class Videos:
    """Encodes images, and takes the place of a data set's own encoder: see `LeRobotDataset`."""

    def __init__(self, dataset: Any, statistics: Callable[[ndarray], Statistics]) -> None:
        """Write the videos of a new data set, which closes this when it is finalised.

        `statistics` returns those of each of the columns of an array.
        """
        self._statistics = statistics
        self._files = {key: _Video(dataset, key) for key in dataset.meta.video_keys}
        dataset._streaming_encoder = self
        dataset._save_episode_video = lambda key, _, temp_path: self._files[key].episode()

    def add(self, key: str, images: Iterable[ndarray]) -> None:
        """Encode the images (H, W, 3) of the next episode."""
        self._files[key].add(images)

    def finish_episode(self) -> dict[str, tuple[Path, Statistics]]:
        """Return the statistics of the colours of the last episode's images, 0 to 255."""
        return {
            key: (Path(), self._statistics(np.concatenate(file.small)) | {"count": file.count})
            for key, file in self._files.items()
        }

    def close(self) -> None:
        """End all files."""
        for file in self._files.values():
            file.close()


class _Video:
    """The videos of one camera, a file after the other."""

    def __init__(self, dataset: Any, key: str) -> None:
        self._dataset, self._key = dataset, key
        self._height, self._width, _ = dataset.features[key]["shape"]
        self._place = 0, 0  # chunk and file
        self._file: Any = None
        self._first = self._end = 0  # images of the last episode in the file
        self._size = 0  # [bytes] of the file
        self.small: list[ndarray] = []
        if min(self._height, self._width) < LEAST_SIDE or self._height % 2 or self._width % 2:
            raise DatasetError(
                f"{key} has images of {self._width} x {self._height} px; AV1 takes even sides of"
                f" {LEAST_SIDE} px and more: scale them, or convert without: --images ''"
            )

    @property
    def _path(self) -> Path:
        chunk, file = self._place
        named = {"video_key": self._key, "chunk_index": chunk, "file_index": file}
        return Path(self._dataset.root, self._dataset.meta.video_path.format(**named))

    def add(self, images: Iterable[ndarray]) -> None:
        meta, fps = self._dataset.meta, self._dataset.fps
        if self._file and self._size >= meta.video_files_size_in_mb << 20:
            self.close()
            chunk, file = self._place
            self._place = divmod(chunk * meta.chunks_size + file + 1, meta.chunks_size)
        if self._file is None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._file, self._end, self._size = av.open(str(self._path), "w"), 0, 0
            self._stream: Any = self._file.add_stream(CODEC, fps, options=OPTIONS)
            self._stream.pix_fmt = "yuv420p"
            self._stream.width, self._stream.height = self._width, self._height
            self._stream.time_base = Fraction(1, fps)
        self._first, self.small = self._end, []
        every = max(1, max(self._height, self._width) // THUMBNAIL)
        for image in images:
            if image.shape != (self._height, self._width, 3):
                raise DatasetError(
                    f"{self._key} has images of {self._width} x {self._height} and of"
                    f" {image.shape[1]} x {image.shape[0]} px; all must have one size"
                )
            frame = av.VideoFrame.from_ndarray(image, format="rgb24")
            frame.pts, frame.time_base = self._end, Fraction(1, fps)
            self._write(self._stream.encode(frame))
            self.small.append(image[::every, ::every].reshape(-1, 3).copy())
            self._end += 1

    @property
    def count(self) -> ndarray:
        return np.array([len(self.small)])

    def episode(self) -> dict[str, Any]:
        name, (chunk, file), fps = f"videos/{self._key}", self._place, self._dataset.fps
        return {
            f"{name}/chunk_index": chunk,
            f"{name}/file_index": file,
            f"{name}/from_timestamp": self._first / fps,
            f"{name}/to_timestamp": self._end / fps,
        }

    def _write(self, packets: list[Any]) -> None:
        self._file.mux(packets)
        self._size += sum(packet.size for packet in packets)

    def close(self) -> None:
        if self._file is not None:
            self._write(self._stream.encode())
            self._file.close()
            self._file = None
