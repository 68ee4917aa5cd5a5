"""Report of a body that was checked: what it is, law by law whether it holds, and what breaks many. Pure."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.body import Capabilities
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.testing.laws import Finding

Verdict = Literal["holds", "broken", "not judged", "does not apply"]


class Stated(Struct, frozen=True, kw_only=True):
    """Exactness that is stated of a body, and how it is to be checked.

    tolerance: error of its estimates from point to point. noise: standard deviation of a reading of a joint.
    accuracy: how near joints and eyes come to where they are to be. real_time: it has a clock of its own.
    world: where targets are; None: the suite's.
    """

    tolerance: Seconds
    noise: Radians
    accuracy: Radians
    real_time: bool = False
    world: World | None = None


class Cause(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Something that keeps laws from being judged.

    what: in words. behaviors: those that it keeps from being performed, in words; empty: it was found elsewhere.
    laws: names of the laws in which it showed, or which had nothing left to be judged by.
    """

    what: str
    behaviors: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()


class CheckedLaw(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One law and what came of it.

    law: its name, in words. topic: what it is about. says: what holds. usually: what it is if it does not hold.
    trials: how often it was tried; each is one seed, crowd or fault. reasons: why it, or some of its trials, do not
    apply. seconds: time that it took on the wall clock.
    """

    law: str
    topic: str
    says: str
    usually: str
    verdict: Verdict
    trials: int
    findings: tuple[Finding, ...] = ()
    reasons: tuple[str, ...] = ()
    seconds: Seconds = 0.0


class BodyReport(Struct, frozen=True, kw_only=True):
    """Everything that a check has found.

    driver: the name that it was asked for by. asked: behaviors that it was asked for, in words. not_asked: those that
    it cannot do, with the reason. unknown: types that it has, and the suite has no behavior of. estimate: median time
    that one estimate took. causes: what broke many laws, or the first look already. not_tried: laws that it did not
    come to. is_stopped: true if somebody has stopped it. notes: what is worth knowing, and breaks no law. fastest:
    that each joint was seen to be while its limits were judged, radians per second. seconds: time of the whole check
    on the wall clock.
    """

    driver: str
    capabilities: Capabilities
    stated: Stated
    asked: tuple[str, ...]
    not_asked: tuple[str, ...]
    unknown: tuple[str, ...]
    estimate: Seconds
    laws: tuple[CheckedLaw, ...] = ()
    causes: tuple[Cause, ...] = ()
    not_tried: tuple[str, ...] = ()
    is_stopped: bool = False
    notes: tuple[str, ...] = ()
    fastest: Mapping[str, float] = {}
    seconds: Seconds = 0.0

    @property
    def is_good(self) -> bool:
        """True if some law holds, and nothing is broken or left out."""
        is_whole = not (self.causes or self.of("broken") or self.of("not judged") or self.is_stopped)
        return is_whole and bool(self.of("holds"))

    def of(self, verdict: Verdict) -> list[CheckedLaw]:
        """List the laws of which this is true."""
        return [each for each in self.laws if each.verdict == verdict]


def as_json(report: BodyReport) -> str:
    """Write it as one JSON object."""
    return msgspec.json.encode({"good": report.is_good, **msgspec.to_builtins(report)}).decode()


def told_once(laws: Iterable[CheckedLaw], known: Sequence[Cause]) -> tuple[tuple[CheckedLaw, ...], tuple[Cause, ...]]:
    """Find what shows in several laws, and take these laws for not judged where nothing else is wrong.

    known: what the first look has found; it counts also where it shows in one law, or in none.
    """
    laws = tuple(laws)
    shown: dict[str, dict[str, None]] = {cause.what: {} for cause in known}
    for law in laws:
        for finding in law.findings:
            if finding.cause:
                shown.setdefault(finding.cause, {})[law.law] = None
    first = {cause.what: cause.behaviors for cause in known}
    causes = tuple(
        Cause(what=what, behaviors=first.get(what, ()), laws=tuple(names))
        for what, names in shown.items()
        if what in first or len(names) > 1
    )
    shared = {cause.what for cause in causes}
    judged = (
        replace(law, verdict="not judged")
        if law.findings and all(finding.cause in shared for finding in law.findings)
        else law
        for law in laws
    )
    return tuple(judged), causes


def by_words(outcomes: Mapping[str, str]) -> tuple[Cause, ...]:
    """Put together behaviors of which the same is true.

    outcomes: what went wrong with each behavior, both in words.
    """
    found: dict[str, list[str]] = {}
    for behavior, what in outcomes.items():
        found.setdefault(what, []).append(behavior)
    return tuple(Cause(what=what, behaviors=tuple(behaviors)) for what, behaviors in found.items())
