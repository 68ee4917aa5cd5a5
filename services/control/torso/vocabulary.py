"""Gestures, faces and postures of the simulated torso."""

from collections.abc import Mapping

GESTURES: Mapping[str, tuple[tuple[float, float, float], ...]] = {
    "BEAT": ((0, 22, 112), (4, 16, 82), (8, 2, 92)),
    "WAVE": ((0, 20, 125), (-18, 26, 118), (16, 22, 124)),
}
"""Inward yaw, shoulder pitch and elbow in degrees: ready, stroke, stroke_end."""
FACES: Mapping[str, Mapping[str, float]] = {
    "SMILE": {"mouth_corners": 1.0}, "RAISE_MOUTH_CORNERS": {"mouth_corners": 1.0},
    "LOWER_MOUTH_CORNERS": {"mouth_corners": -1.0}, "FROWN": {"brows": -1.0, "mouth_corners": -0.5},
    "RAISE_BROWS": {"brows": 1.0}, "LOWER_BROWS": {"brows": -1.0}, "OBLIQUE_BROWS": {"brows": 0.5},
    "OPEN_MOUTH": {"mouth": 1.0}, "CLOSE_EYES": {"lids": 1.0}, "BLINK": {"lids": 1.0},
    "NEUTRAL": {},
}  # fmt: skip
ACTION_UNITS: Mapping[int, str] = {
    1: "RAISE_BROWS", 2: "RAISE_BROWS", 4: "LOWER_BROWS", 6: "SMILE", 12: "RAISE_MOUTH_CORNERS",
    15: "LOWER_MOUTH_CORNERS", 25: "OPEN_MOUTH", 26: "OPEN_MOUTH", 27: "OPEN_MOUTH", 43: "CLOSE_EYES", 45: "BLINK",
}  # fmt: skip
POSTURES: Mapping[str, tuple[float, float]] = {
    "": (0, 0), "UPRIGHT": (0, 0), "LEAN_FORWARD": (0, 12), "LEAN_BACK": (0, -8), "TURN_LEFT": (15, 0),
    "TURN_RIGHT": (-15, 0),
}  # fmt: skip
"""Turn and lean of the torso in degrees."""
