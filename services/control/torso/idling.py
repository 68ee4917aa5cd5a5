"""Idle motion of the torso at an instant: what of it there is, beside what its behaviors do. Pure."""

from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.extras import Idle
from engage_hri.services.control.figure.alive import Alive
from engage_hri.services.control.torso.mouth import Mouth
from engage_hri.services.control.torso.torso import Torso


def idling(torso: Torso, mouth: Mouth, alive: Alive | None, now: Seconds) -> Idle:
    """Lips with the voice, and of a torso that is alive what it does by itself where nothing else is done."""
    face = torso.tracks["face"]
    expression = dict(zip(face.joints, face.angles(now), strict=True))
    added = mouth.added(now, expression)
    quick_at = now if mouth.is_moving(now) else inf
    if alive is None:
        return Idle(added=added, quick_at=quick_at)
    busy = {part for part, track in torso.tracks.items() if track.is_moving(now)} | {*torso.runs}
    by_itself = alive.added(now, expression, face_rests="face" not in busy, body_rests=not busy - {"face"})
    added = {joint: added.get(joint, 0.0) + by_itself.get(joint, 0.0) for joint in (*added, *by_itself)}
    return Idle(added=added, quick_at=min(quick_at, alive.quick_at(now)))
