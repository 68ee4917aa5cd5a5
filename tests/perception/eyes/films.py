"""Films of rendered people, as a browser takes them for its camera: raw pictures with a rate (YUV4MPEG2)."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from tests.perception.eyes.drawing import Picture
from tests.perception.eyes.people import Looks, Person, Pose, drawn, noisy

RATE = 15


def posed(looks: Looks, poses: Sequence[Pose], seconds: float) -> list[Picture]:
    """Somebody who holds each of these poses for a while. No two pictures are the same, as of any camera."""
    person, count = Person(looks), round(seconds * RATE)
    stills = [drawn([(person, pose)]) for pose in poses]
    return [noisy(still, 2.0, number * count + k) for number, still in enumerate(stills) for k in range(count)]


def written(path: Path, pictures: Iterable[Picture]) -> Path:
    """Write a film. Its pictures are of one size, of which both sides are even."""
    with path.open("wb") as file:
        for number, picture in enumerate(pictures):
            file.write((b"" if number else head_of(picture)) + frame(picture))
    return path


def head_of(picture: Picture) -> bytes:
    """What a film of such pictures begins with."""
    height, width = picture.shape[:2]
    return f"YUV4MPEG2 W{width} H{height} F{RATE}:1 Ip A1:1 C420jpeg\n".encode()


def frame(picture: Picture) -> bytes:
    """A picture as it stands in a film: all of a size are of one length."""
    return b"FRAME\n" + cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420).tobytes()


def read(path: Path) -> Iterator[Picture]:
    """Pictures of a film, as who decodes it sees them."""
    with path.open("rb") as file:
        words = file.readline().decode().split()
        width, height = (int(word[1:]) for word in words[1:3])
        while file.readline():
            raw = np.frombuffer(file.read(width * height * 3 // 2), np.uint8).reshape(height * 3 // 2, width)
            yield cv2.cvtColor(raw, cv2.COLOR_YUV2RGB_I420)
