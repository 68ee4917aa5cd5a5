"""Findings in words: what went wrong with a body. Pure."""

import traceback
from collections.abc import Sequence
from pathlib import Path

from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError
from engage_hri.services.control.bases.error_place import place_of, words_of
from engage_hri.services.control.contract.body import BehaviorRefused, BodyFailed
from engage_hri.services.control.testing.laws import Finding, LawBroken
from engage_hri.services.runtime.virtual_time import Deadlock, TimeRanOut

_SUITE = str(Path(__file__).parent)


def findings_of(error: BaseException, behavior: str = "") -> Sequence[Finding] | None:
    """Put what went wrong with a body in words; None: it is no fault of a body."""
    match error:
        case LawBroken():
            return [each if each.behavior else replace(each, behavior=behavior) for each in error.findings]
        case BodyFailed() | BehaviorRefused():
            did = "failed" if isinstance(error, BodyFailed) else "refused"
            measured = f"it {did}: {error.fault}"
            return [
                Finding(behavior=behavior, expected="that it can do this", measured=measured, cause=cause_of(error))
            ]
        case EngageError():
            return [Finding(behavior=behavior, expected="a body that can be had", measured=str(error.fault))]
        case Deadlock() | TimeRanOut():
            return [
                Finding(
                    behavior=behavior,
                    expected="that it comes to an end",
                    measured=str(error),
                    advice="something waits for what never comes",
                    cause=cause_of(error),
                )
            ]
        case _ if _is_ours(error):
            measured = f"{words_of(error)}{_at(error)}"
            advice = "this is a bug of the suite, or it cannot deal with what the body has told before"
            return [Finding(behavior=behavior, expected="that the suite can go on", measured=measured, advice=advice)]
        case Exception():
            return [
                Finding(
                    behavior=behavior,
                    expected="no error but BehaviorRefused and BodyFailed",
                    measured=f"{words_of(error)}{_at(error)}",
                    advice="control fails the behavior and takes the body home at such an error",
                    cause=cause_of(error),
                )
            ]
    return None


def cause_of(error: BaseException) -> str:
    """Say what is behind an error, in the same words wherever it shows."""
    match error:
        case BodyFailed() | BehaviorRefused():
            return f"it {'failed' if isinstance(error, BodyFailed) else 'refused'}: {error.fault.reason}"
        case Deadlock() | TimeRanOut():
            return "something waits for what never comes"
    return f"its driver breaks: {words_of(error)}{_at(error)}"


def _at(error: BaseException) -> str:
    """Say where an error was raised: ` at pan_tilt.py, line 14`. What it came through in the suite does not count."""
    place = place_of(error, _beyond_the_suite(error))
    return f" at {Path(place.file).name}, line {place.line}" if place else ""


def _is_ours(error: BaseException) -> bool:
    """True for an error that the suite itself has raised."""
    return bool(error.__traceback__) and not _beyond_the_suite(error)


def _beyond_the_suite(error: BaseException) -> Sequence[traceback.FrameSummary]:
    """The places that an error has come through since it left the suite, the innermost last."""
    frames = traceback.extract_tb(error.__traceback__)
    last = max((number for number, each in enumerate(frames) if each.filename.startswith(_SUITE)), default=-1)
    return frames[last + 1 :]
