"""Laws of perception of people, judged on all that a source has told on the bus. Pure.

    for verdict in judged(evidence): ...      # a law is judged when it is asked for

What is broken is told with what the mistake mostly is. Nothing here knows how heads are found.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import atan2, degrees, dist, hypot, remainder
from statistics import mean, median, pstdev
from typing import NamedTuple

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActorFound, ActorLost, HeadPose, Looked
from engage_hri.schemas.units import Degrees, Seconds, Vector

STALL: Seconds = 0.5
"""Longest time between two pictures in which a source has looked; the same as recognition's."""
GAP: Seconds = 2.0
"""Time for which somebody may be out of sight; and within which a stall that lasts is told."""
OLDEST: Seconds = 0.5
"""Age at which recognition does not take a head pose any more."""
AT_ONCE: Seconds = 0.002
"""Age that no picture can have: light, wires and a look at it take longer."""
NEAREST, FARTHEST = 0.1, 10.0
"""Metres between which heads are."""
SAME_PLACE, SWIFT = 0.3, 3.0
"""Metres between the places of one person who is lost and found; metres a second that nobody's head moves."""
BIAS: Degrees = 8.0
"""Mean error of a direction that is no mistake of frame or unit."""
MOST_SCATTER: Degrees = 25.0
"""Standard deviation of errors from which on there is a mistake."""
HONEST = (0.85, 0.995)
"""Share of errors within two stated deviations: 95 of 100 would be right."""
ENOUGH = 20
"""Poses from which on something is judged."""


class Told(NamedTuple):
    """A message. at: instant that it tells of. came: when it came. Seconds, on one clock."""

    message: Message
    at: Seconds
    came: Seconds


class TrueLook(NamedTuple):
    """A truth: from then on until then this head faced a place. person: a name of any kind."""

    since: Seconds
    until: Seconds
    person: str
    place: Vector


class Evidence(NamedTuple):
    """All that was told, in the order in which it came. truth: what is known of it, by the same clock.

    is_live: it was told while it was seen; else what is played has no age.
    """

    told: Sequence[Told]
    truth: Sequence[TrueLook] = ()
    is_live: bool = True

    def of(self, kind: type) -> list[Told]:
        return [each for each in self.told if isinstance(each.message, kind)]

    def heads(self) -> dict[str, list[tuple[HeadPose, Seconds, Seconds]]]:
        """Poses of each person: each with its instant, and when it came."""
        found: dict[str, list[tuple[HeadPose, Seconds, Seconds]]] = {}
        for message, at, came in self.told:
            if isinstance(message, HeadPose):
                found.setdefault(message.actor, []).append((message, at, came))
        return found


class Verdict(NamedTuple):
    """A law, judged. broken: in words, where; none: it holds. advice: what it mostly is. unjudged: why it was not."""

    law: str
    broken: str = ""
    advice: str = ""
    unjudged: str = ""


Finding = tuple[str, str]
"""What is broken, and what it mostly is; both empty: nothing."""
FINE: Finding = ("", "")


class Unjudged(Exception):
    """A law cannot be judged by this evidence. The text says why."""


def judged(evidence: Evidence) -> Iterator[Verdict]:
    """Judge one law after the other."""
    for law, judge in LAWS.items():
        try:
            broken, advice = judge(evidence)
            yield Verdict(law, broken, advice)
        except Unjudged as why:
            yield Verdict(law, unjudged=str(why))


def _instants_grow(evidence: Evidence) -> Finding:
    for person, poses in _some_heads(evidence).items():
        for (_, before, _), (_, at, _) in pairwise(poses):
            if at <= before:
                what = "the same instant twice" if at == before else f"an instant {before - at:.3f} s before the last"
                return f"{person} is told with {what}, at {at:.2f} s", (
                    "one stamp for each picture, that of its capture; pictures that are overtaken are dropped"
                )
    return FINE


def _instants_are_of_capture(evidence: Evidence) -> Finding:
    if not evidence.is_live:
        raise Unjudged("what is played has no age")
    ages = [came - at for poses in _some_heads(evidence).values() for _, at, came in poses]
    middle = median(ages)
    if middle > OLDEST:
        return f"poses are {middle:.2f} s old when they come: recognition drops what is older than {OLDEST:g} s", (
            "is the clock that of the stamps' name? else look at smaller pictures, and at the newest only"
        )
    if middle < -AT_ONCE:
        return f"poses are of {-middle:.2f} s after they came", "is the clock that of the stamps' name?"
    if middle < AT_ONCE:
        return f"half of the poses are less than {1000 * AT_ONCE:g} ms old when they come", (
            "stamps of sending instead of capture? read the clock when the picture is taken, before it is looked at"
        )
    return FINE


def _places_are_metres(evidence: Evidence) -> Finding:
    for person, poses in _some_heads(evidence).items():
        far = median(hypot(*pose.position) for pose, _, _ in poses)
        if not NEAREST < far < FARTHEST:
            advice = (
                "millimetres? places are in metres" if far > FARTHEST else "in the robot's frame, not the head's?"
            )
            return f"{person} is {far:.4g} m from the middle of the robot's foot", advice
    return FINE


def _absence_is_said(evidence: Evidence) -> Finding:
    looked = [at for _, at, _ in evidence.of(Looked)]
    lost = evidence.of(ActorLost)
    if not looked and not lost:
        raise Unjudged("nobody was lost, and it does not say when it looks")
    if not looked:
        return "people are lost, and it never says that it has looked (`Looked`)", (
            "tell `Looked` with each picture: whom it has seen, and whom not"
        )
    for message, at, came in lost:
        assert isinstance(message, ActorLost)
        if message.left:
            continue
        times = [at, *(each for each in looked if at < each <= came), came]
        seeing = sum(after - before for before, after in pairwise(times) if after - before <= STALL)
        is_end = not any(each > came for each in looked)
        if seeing < GAP - STALL and not is_end:
            return f"{message.actor} is lost at {at:.2f} s after {seeing:.1f} s of looking for them", (
                f"a stall is no absence: only time in which pictures were looked at counts, and of that {GAP:g} s"
            )
    return FINE


def _ids_are_kept(evidence: Evidence) -> Finding:
    heads = _some_heads(evidence)
    for person, poses in heads.items():
        for (one, before, _), (other, at, _) in pairwise(poses):
            way = dist(one.position, other.position)
            if at > before and way > SAME_PLACE + SWIFT * (at - before):
                return f"{person} is at two places at once, {way:.1f} m apart, at {at:.2f} s", (
                    "two people who cross: whose a face is goes by where each should be by now, not by their order"
                )
    joined = {each.message.actor for each in evidence.of(ActorFound) if each.message.same_as}  # type: ignore[union-attr]
    for person, poses in heads.items():
        first, begin, _ = poses[0]
        for former, others in heads.items():
            last, end, _ = others[-1]
            if former == person or person in joined or end >= begin:
                continue
            if begin - end < GAP and dist(first.position, last.position) < SAME_PLACE:
                return f"{person} comes where {former} was {begin - end:.1f} s before", (
                    f"keep an id for {GAP:g} s while a face is out of sight, or tell `same_as`"
                )
    return FINE


def _stalls_are_told(evidence: Evidence) -> Finding:
    looked = [(at, came) for _, at, came in evidence.of(Looked)]
    if len(looked) < ENOUGH:
        raise Unjudged("it does not say when it looks (`Looked`)")
    if not any(b[1] - a[1] > GAP for a, b in pairwise(looked)):
        raise Unjudged("it never stalled: cover nothing, but unplug the camera for 5 s, or stop its process")
    for (_, before), (_, after) in pairwise(looked):
        faults = [each.came for each in evidence.of(Fault) if before < each.came <= before + GAP + 0.1]
        if after - before > GAP and not faults:
            return f"it told nothing from {before:.2f} to {after:.2f} s, and no fault", (
                f"tell a `Fault` with a reason in words within {GAP:g} s, and that it sees again"
            )
    return FINE


def _directions_are_right(evidence: Evidence) -> Finding:
    errors = _errors(evidence)
    aside, above = (mean(each.angles[axis] for each in errors) for axis in (0, 1))
    scatter = max(pstdev(each.angles[axis] for each in errors) for axis in (0, 1))
    if hypot(aside, above) <= BIAS and scatter <= MOST_SCATTER:
        return FINE
    broken = f"heads are told {aside:+.0f} degrees to their left and {above:+.0f} up of where they face"
    broken += f" in the mean, with a scatter of {scatter:.0f}"
    for advice, turned in MISTAKES.items():
        other = _errors(evidence, turned)
        if mean(hypot(*each.angles) for each in other) < 0.5 * mean(hypot(*each.angles) for each in errors):
            return broken, advice
    if scatter > MOST_SCATTER:
        return broken, "degrees or radians? an angle in degrees that is taken for radians points anywhere"
    return (
        broken,
        "is the camera where it is said to be, with its tilt? a bias of one person is learned by sure looks",
    )


def _spreads_are_honest(evidence: Evidence) -> Finding:
    pairs = [(each.angles, each.stated) for each in _errors(evidence) if each.stated is not None]
    if len(pairs) < ENOUGH:
        raise Unjudged("no deviation is stated (`yaw_spread`, `pitch_spread`)")
    for axis, name in ((0, "yaw_spread"), (1, "pitch_spread")):
        stated = [degrees(each[axis]) for _, each in pairs]
        shares = [abs(angles[axis]) < 2 * width for (angles, _), width in zip(pairs, stated, strict=True)]
        share, middle = mean(shares), median(stated)
        if HONEST[0] <= share <= HONEST[1] or (share > HONEST[1] and middle < 2.0):
            continue
        advice = "the deviation of each error, also of what is the same in all pictures of a person"
        if middle > 40 and share > HONEST[1]:
            advice = "degrees or radians? it is radians"
        elif share > HONEST[1]:
            advice = "state less: what is called unsure is named with its neighbors"
        broken = f"{100 * share:.0f} % of errors are within two {name}s of {middle:.1f} degrees; 95 would be right"
        return broken, advice
    return FINE


LAWS: dict[str, Callable[[Evidence], Finding]] = {
    "instants of capture grow": _instants_grow,
    "instants are of capture, not of sending": _instants_are_of_capture,
    "places are metres in the robot's frame": _places_are_metres,
    "absence only when it is said": _absence_is_said,
    "ids are kept over gaps and crossings": _ids_are_kept,
    "a stall that lasts is told": _stalls_are_told,
    "heads face where they do": _directions_are_right,
    "stated deviations are honest": _spreads_are_honest,
}


def _some_heads(evidence: Evidence) -> dict[str, list[tuple[HeadPose, Seconds, Seconds]]]:
    heads = {person: poses for person, poses in evidence.heads().items() if len(poses) >= 2}
    if sum(map(len, heads.values())) < ENOUGH:
        raise Unjudged(f"there are fewer than {ENOUGH} head poses")
    return heads


class PoseError(NamedTuple):
    """Error of a direction to its left and up, and what was stated of it, in radians."""

    angles: tuple[Degrees, Degrees]
    stated: tuple[float, float] | None


def _errors(evidence: Evidence, turned: Callable[[Vector], Vector] = lambda direction: direction) -> list[PoseError]:
    """Errors of all poses of which the truth is known. turned: what is done to directions before."""
    if not evidence.truth:
        raise Unjudged("no truth is given (--truth)")
    found: list[PoseError] = []
    for poses in evidence.heads().values():
        for pose, at, _ in poses:
            true = [each for each in evidence.truth if each.since <= at <= each.until]
            if len(true) != 1 or not any(pose.direction):
                continue
            x, y, z = (b - a for a, b in zip(pose.position, true[0].place, strict=True))
            left, up = _bearing(turned(pose.direction))
            true_left, true_up = _bearing((x, y, z))
            is_stated = pose.yaw_spread is not None and pose.pitch_spread is not None
            stated = (pose.yaw_spread or 0.0, pose.pitch_spread or 0.0) if is_stated else None
            found.append(PoseError((remainder(left - true_left, 360.0), up - true_up), stated))
    if len(found) < ENOUGH:
        raise Unjudged(f"the truth is known of fewer than {ENOUGH} poses")
    return found


def _bearing(direction: Vector) -> tuple[Degrees, Degrees]:
    x, y, z = direction
    return degrees(atan2(y, x)), degrees(atan2(z, hypot(x, y)))


MISTAKES: dict[str, Callable[[Vector], Vector]] = {
    "mirrored? a camera's picture for the person themselves has left and right changed": lambda d: (
        d[0],
        -d[1],
        d[2],
    ),
    "up and down changed? rows of a picture grow downwards": lambda d: (d[0], d[1], -d[2]),
    "backwards? a direction goes from the head to what it faces": lambda d: (-d[0], -d[1], -d[2]),
    "in the axes of the camera? the robot's are ahead, left, up": lambda d: (d[2], -d[0], -d[1]),
}
"""Mistakes of directions, and what undoes each."""
