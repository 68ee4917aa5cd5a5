"""Faces as a source of landmarks has found them in a picture: points alone, never the picture.

A source says of every picture that it has looked at what it found there. A message without a face says that nobody
was seen at that instant; no message says nothing: a camera that stalls is no departure.
"""

from typing import Annotated

from msgspec import Meta, Struct

from engage_hri.schemas.units import Probability, Stamp

FACE_POINTS = 468
"""Points of a face, in the order of the face mesh of MediaPipe, which browsers and Python have alike."""
EIGHTHS = 8
"""Steps of a coordinate in one pixel."""
_BYTES = FACE_POINTS * 3 * 2
MOST_FACES = 16
Pixels = Annotated[int, Meta(ge=16, le=4096)]


class FacePoints(Struct, frozen=True, kw_only=True, tag=False, omit_defaults=True):
    """Points of one face in a picture.

    points: x to the right, y down, and depth away from the camera in the same scale, of each point, in eighths of a
    pixel; 16 bit, little-endian. confidence: that it is a face.
    """

    points: Annotated[bytes, Meta(min_length=_BYTES, max_length=_BYTES)]
    confidence: Probability = 1.0


class FaceLandmarks(Struct, frozen=True, kw_only=True, tag="face_landmarks", omit_defaults=True):
    """stream: perception. All faces that a source has found in one picture; none: it has looked, and saw nobody.

    at: when the picture was taken; the source has looked until then. width, height: of the picture, in pixels.
    over: there was no picture: the source, which people switch on and off, looks no more.
    """

    at: Stamp
    width: Pixels
    height: Pixels
    faces: Annotated[tuple[FacePoints, ...], Meta(max_length=MOST_FACES)] = ()
    over: bool = False
