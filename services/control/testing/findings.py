"""Words for a law that a body has broken: what was expected, what was measured, and where. Pure.

Angles are in degrees and times in milliseconds: these words are for people who stand beside a robot.
"""

import math
import traceback
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NoReturn

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    Gesture,
    Head,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
    Wait,
    expressed,
    posed,
)
from engage_hri.schemas.body import BodyPose, Ray
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.services.control.bases.driver_guard import place_of, words_of
from engage_hri.services.control.contract.body import BehaviorRefused, BodyFailed
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut

NEVER_ENDS = "what is begun never ends"
NOTHING_MOVES = "nothing moves"
WRONG_UNIT = "degrees or radians?"
"""Causes for which much cannot be judged; words follow them."""
OLD_READINGS = "the readings of its joints are old"
"""Cause for which motion looks like jumps."""
OTHER_WAY = "it has turned the other way: is a sign turned around?"


class Finding(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One way in which a law was broken.

    behavior: what was performed; empty: it concerns none. sync: the sync point in question; empty: none.
    advice: what to do about this one; empty: what the law says of itself. cause: what is behind it, in the same words
    wherever it shows; empty: nothing but what the law is about.
    """

    expected: str
    measured: str
    behavior: str = ""
    sync: str = ""
    advice: str = ""
    cause: str = ""

    def __str__(self) -> str:
        place = ", ".join(filter(None, (self.behavior, self.sync)))
        text = f"expected {self.expected}; measured {self.measured}"
        text = f"{place}: {text}" if place else text
        return f"{text} ({self.advice})" if self.advice else text


class LawBroken(AssertionError):
    """A body has broken a law of the contract. findings: at least one."""

    def __init__(self, findings: Sequence[Finding]) -> None:
        self.findings = tuple(findings)
        super().__init__("\n".join(map(str, self.findings)))


def broken(
    sync: str = "",
    *,
    expected: str,
    measured: str,
    behavior: BlockBehavior | None = None,
    advice: str = "",
    cause: str = "",
) -> NoReturn:
    """Raise LawBroken with this finding. behavior: None: the one that the law is judged by, if it is."""
    __tracebackhide__ = True
    place = "" if behavior is None else named(behavior)
    finding = Finding(behavior=place, sync=sync, expected=expected, measured=measured, advice=advice, cause=cause)
    raise LawBroken([finding])


# -- words --------------------------------------------------------------------------------------------------------


def named(behavior: BlockBehavior) -> str:
    """Words for a behavior: `gaze at near-right`, `head NOD 3 times`."""
    kind = type_name(behavior)
    match behavior:
        case Pointing(target=target, mode=mode) if mode:
            return f"{kind} at {target} with {mode}"
        case Gesture(lexeme=lexeme, mode=mode):
            return f"{kind} {lexeme} with {mode}" if mode else f"{kind} {lexeme}"
        case Head(lexeme=lexeme, repetition=repetition):
            return f"{kind} {lexeme} {repetition} times" if repetition > 1 else f"{kind} {lexeme}"
        case Speech(text=text):
            return f"{kind} {text!r}"
        case Wait(duration=duration):
            return f"{kind} {duration} s"
        case Face() | FaceLexeme() | FaceFacs() | FaceShift():
            shown = (each.lexeme or f"AU{each.au}" for each in expressed(behavior))
            return f"{kind} {' '.join(shown)}"
        case Posture() | PostureShift() | Pose():
            stance = "" if isinstance(behavior, Pose) else behavior.stance
            return " ".join(filter(None, (kind, stance, *(each.lexeme for each in posed(behavior)))))
    target = getattr(behavior, "target", "")
    preposition = "at" if isinstance(behavior, Gaze | Pointing) else "to"
    return f"{kind} {preposition} {target}" if target else kind


def ms(seconds: Seconds) -> str:
    """Words for a duration: `350 ms`."""
    return f"{seconds * 1000:.0f} ms" if abs(seconds) < 10.0 else f"{seconds:.1f} s"


def degrees(angle: Radians) -> str:
    """Words for an angle: `1.2 degrees`."""
    size = abs(math.degrees(angle))
    return f"{math.degrees(angle):.{2 if size < 0.1 else 1 if size < 100.0 else 0}f} degrees"


def listed(names: Iterable[str]) -> str:
    """Words for names of points, or for none."""
    return ", ".join(names) or "nothing"


def angles(pose: BodyPose) -> dict[str, Radians]:
    """The angle of each joint, by its name."""
    return {each.joint: each.angle for each in pose.joints}


def turned(one: Mapping[str, Radians], other: Mapping[str, Radians]) -> Radians:
    """The most by which a joint of one pose has turned in another one; 0 if they have none in common."""
    return max((abs(angle - other[joint]) for joint, angle in one.items() if joint in other), default=0.0)


# -- rays and points -----------------------------------------------------------------------------------------------


def aside(ray: Ray, point: Vector) -> Radians:
    """Angle between a ray and the direction from its origin to a point."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.acos(max(-1.0, min(1.0, along / math.hypot(*way))))


def angle(one: Vector, other: Vector) -> Radians:
    """Angle between two unit vectors."""
    return math.acos(max(-1.0, min(1.0, sum(a * b for a, b in zip(one, other, strict=True)))))


def beside(ray: Ray, point: Vector) -> Meters:
    """Distance by which a point lies beside a ray; inf behind it."""
    way = [there - here for here, there in zip(ray.origin, point, strict=True)]
    along = sum(a * b for a, b in zip(ray.axis, way, strict=True))
    return math.sqrt(max(0.0, sum(each * each for each in way) - along * along)) if along > 0 else math.inf


# -- errors -------------------------------------------------------------------------------------------------------

_SUITE = str(Path(__file__).parent)


def findings_of(error: BaseException, behavior: str = "") -> Sequence[Finding] | None:
    """Put what went wrong with a body in words; None: it is no fault of a body."""
    raised, cause, advice = f"{words_of(error)}{_at(error)}", cause_of(error), ""
    match error:
        case LawBroken():
            return [each if each.behavior else replace(each, behavior=behavior) for each in error.findings]
        case BodyFailed() | BehaviorRefused():
            expected, measured = "that it can do this", f"it {_did(error)}: {error.fault}"
        case EngageError():
            expected, measured, cause = "a body that can be had", str(error.fault), ""
        case Deadlock() | TimeRanOut():
            expected, measured, advice = "that it comes to an end", str(error), cause
        case Exception() if error.__traceback__ and not _beyond_the_suite(error):
            expected, measured, cause = "that the suite can go on", raised, ""
            advice = "this is a bug of the suite, or it cannot deal with what the body has told before"
        case Exception():
            expected, measured = "no error but BehaviorRefused and BodyFailed", raised
            advice = "control fails the behavior and takes the body home at such an error"
        case _:
            return None
    return [Finding(behavior=behavior, expected=expected, measured=measured, advice=advice, cause=cause)]


def cause_of(error: BaseException) -> str:
    """Say what is behind an error, in the same words wherever it shows."""
    match error:
        case BodyFailed() | BehaviorRefused():
            return f"it {_did(error)}: {error.fault.reason}"
        case Deadlock() | TimeRanOut():
            return "something waits for what never comes"
    return f"its driver breaks: {words_of(error)}{_at(error)}"


def _did(error: BodyFailed | BehaviorRefused) -> str:
    return "failed" if isinstance(error, BodyFailed) else "refused"


def _at(error: BaseException) -> str:
    """Say where an error was raised: ` at pan_tilt.py, line 14`. What it came through in the suite does not count."""
    place = place_of(error, _beyond_the_suite(error))
    return f" at {Path(place.file).name}, line {place.line}" if place else ""


def _beyond_the_suite(error: BaseException) -> Sequence[traceback.FrameSummary]:
    """The places that an error has come through since it left the suite, the innermost last."""
    frames = traceback.extract_tb(error.__traceback__)
    last = max((number for number, each in enumerate(frames) if each.filename.startswith(_SUITE)), default=-1)
    return frames[last + 1 :]
