"""Laws about the body: no point without motion, one owner of a part at a time, home in the end.

What a motion looks like is taken from the words of docs/bml.md and docs/control.md, and measured at the joints and
rays that the body publishes; how the body makes its motions is not known here.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity
from tests.judge.case import PART_OF, Case, Done, Finding
from tests.judge.reading import SHIFTS, WITH_STROKE

POINTING_RADIUS = 0.05
"""Metres around the forearm's axis within which people see what is pointed at, besides the thing's own size."""
GAZE_HALF_ANGLE = 0.1
"""Radians around the gaze axis within which people see what is looked at."""
NODDING = 0.35
"""Radians by which a nod may take the eyes off their target."""
RAISED = 0.12
"""Radians: a joint of an arm that makes a gesture is at least so far from where it rests."""
MOVED = 0.03
"""Radians of rotation without which nothing has been done."""
SHOWN = 0.05
"""Of a face, a share of its range; of a torso, radians: less is not seen."""
LEAST = 0.02
"""Seconds: no body gets from one point of a stroke to the next in less."""
TOGETHER = 0.002
"""Seconds by which one motion may reach into the next."""
ARMS = ("left", "right")
TORSO = ("torso",)
FACE = (
    "left_brow", "right_brow", "brow_slant", "left_lid", "right_lid", "left_mouth_corner", "right_mouth_corner",
    "lips", "jaw",
)  # fmt: skip
NECK = ("neck",)


def motion(case: Case) -> Iterator[Finding]:
    """No point is told without its motion."""
    if not case.is_told_true:
        return
    for done in case.done:
        check = _CHECKS.get(done.asked.type)
        if check is not None:
            for text in check(case, done):
                yield Finding("pointless", done.block, f"{done.name}: {text}", done.asked.id)
        if done.asked.type in WITH_STROKE:
            yield from _stroke_end(case, done)


def _arm(side: str) -> tuple[str, str]:
    """How the names of the joints of an arm begin."""
    return f"{side}_shoulder", f"{side}_elbow"


def _stroke_end(case: Case, done: Done) -> Iterator[Finding]:
    """The end of a stroke is no more told without motion than the stroke."""
    stroke, end = done.time("stroke"), done.time("stroke_end", "strokeEnd")
    if stroke is None or end is None:
        return
    sides = ARMS if done.asked.hand in ("", "both") else (done.asked.hand,)
    prefixes = NECK if done.asked.type == "head" else tuple(joint for side in sides for joint in _arm(side))
    way = case.record.way(case.record.columns(*prefixes), stroke, end)
    if end - stroke < LEAST or way < MOVED / 3:
        where = f"{done.name}: {way:.3f} rad from stroke to its end, {stroke:.3f} to {end:.3f}"
        yield Finding("unmade end of a stroke", done.block, where)


# -- what each type must show ----------------------------------------------------------------------------------------


def _pointing(case: Case, done: Done) -> Iterator[str]:
    if (at := done.time("stroke")) is None:
        return
    entity = case.entity(done.asked.attributes.get("target", ""))
    if entity is None:
        yield "a stroke at something that there is not"
        return
    yield from _with_some_hand(done, partial(_points_with, case, done, entity, at))


def _points_with(case: Case, done: Done, entity: Entity, at: float, side: int) -> Iterator[str]:
    off = _beside(case.record.sample(at).arms[side], entity.position)
    if off > POINTING_RADIUS + entity.radius:
        yield f"at its stroke, {at:.3f}, the forearm passes {off:.2f} m beside {entity.id}{_torso(case, at)}"
    yield from _stroke(case, done, side)


def _gesture(case: Case, done: Done) -> Iterator[str]:
    if (at := done.time("stroke")) is not None:
        yield from _with_some_hand(done, partial(_gestures_with, case, done, at))


def _gestures_with(case: Case, done: Done, at: float, side: int) -> Iterator[str]:
    away = case.record.away(case.record.columns(*_arm(ARMS[side])), at)
    if away < RAISED:
        yield f"at its stroke, {at:.3f}, the {ARMS[side]} arm is {away:.2f} rad from rest"
    yield from _stroke(case, done, side)


def _with_some_hand(done: Done, check: Callable[[int], Iterator[str]]) -> list[str]:
    """What is wrong with the hand that it names, with both, or with the better one if the body has chosen."""
    hand = done.asked.hand
    found = [list(check(side)) for side in range(len(ARMS)) if hand in ("", "both", ARMS[side])]
    return [text for each in found for text in each] if hand else min(found, key=len)


def _stroke(case: Case, done: Done, side: int) -> Iterator[str]:
    """The arm has moved up to the stroke."""
    columns = case.record.columns(*_arm(ARMS[side]))
    start, stroke = done.time("start"), done.time("stroke")
    assert start is not None
    assert stroke is not None
    way = case.record.way(columns, start, stroke)
    if way < MOVED or stroke - start < LEAST:
        yield f"the {ARMS[side]} arm turned {way:.3f} rad from start to stroke, {start:.3f} to {stroke:.3f}"


def _head(case: Case, done: Done) -> Iterator[str]:
    start, stroke = done.time("start"), done.time("stroke")
    if start is None or stroke is None:
        return
    is_shake = done.asked.attributes.get("lexeme", "").upper() == "SHAKE"
    columns = case.record.columns("neck_yaw" if is_shake else "neck_pitch")
    way = case.record.way(columns, start, stroke)
    if way < MOVED or stroke - start < LEAST:
        yield f"the neck turned {way:.3f} rad from start to stroke, {start:.3f} to {stroke:.3f}"


def _gaze(case: Case, done: Done) -> Iterator[str]:
    if (at := done.time(done.asked.main)) is None:
        return
    if done.asked.type in ("gazeShift", "headDirectionShift") and _under_way(case, at, "gaze"):
        return  # Nothing moves: a look lies over it.
    entity = case.entity(done.asked.attributes.get("target", ""))
    if entity is None:
        yield "on a target that there is not"
        return
    off = _angle(case.record.sample(at).gaze, entity.position)
    limit = GAZE_HALF_ANGLE + (NODDING if _under_way(case, at, "head") else 0.0)
    if off > limit:
        yield f"on target at {at:.3f}, and {math.degrees(off):.0f} degrees off {entity.id}{_torso(case, at)}"


def _face(case: Case, done: Done) -> Iterator[str]:
    yield from _shown(case, done, FACE)


def _posture(case: Case, done: Done) -> Iterator[str]:
    yield from _shown(case, done, TORSO)


def _shown(case: Case, done: Done, joints: tuple[str, ...]) -> Iterator[str]:
    at = done.time(done.asked.main)
    if at is None or (done.asked.type in SHIFTS and _under_way(case, at, *_SAME[done.asked.type])):
        return
    away = case.record.away(case.record.columns(*joints), at)
    if away < SHOWN:
        yield f"at {at:.3f} nothing is to be seen of it ({away:.3f})"


_CHECKS: Mapping[str, Callable[[Case, Done], Iterator[str]]] = {
    "pointing": _pointing, "gesture": _gesture, "head": _head, "gaze": _gaze, "gazeShift": _gaze,
    "headDirectionShift": _gaze, "face": _face, "faceLexeme": _face, "faceFacs": _face, "faceShift": _face,
    "posture": _posture, "postureShift": _posture,
}  # fmt: skip
_FACES = ("face", "faceLexeme", "faceFacs")
_SAME: Mapping[str, tuple[str, ...]] = {"faceShift": _FACES, "postureShift": ("posture",)}


_POSED = ("postureShift", "pose")


# -- who has which part ----------------------------------------------------------------------------------------------


def parts(case: Case) -> Iterator[Finding]:
    """No two behaviors make their strokes, or their ways to the target, with one part at one time."""
    if not case.is_told_true:
        return
    spans = [span for done in case.done if (span := _span(done)) is not None and span[1] - span[0] > TOGETHER]
    spans = [span for span in spans if not _is_beneath(case, span)]
    used = _attributed(case, spans)
    for (one, ours), (other, theirs) in combinations(zip(spans, used, strict=True), 2):
        since, until = max(one[0], other[0]), min(one[1], other[1])
        shared = ours & theirs
        if until - since > TOGETHER and shared and not _overlaid(one[2], other[2]):
            text = f"{one[2].block}:{one[2].name} and {other[2].block}:{other[2].name}"
            where = ", ".join(sorted(shared))
            yield Finding("parts", other[2].block, f"{text} both had the {where} from {since:.3f} to {until:.3f}")


Span = tuple[float, float, Done]


def _span(done: Done) -> Span | None:
    first = ("stroke_start", "strokeStart") if done.asked.type in WITH_STROKE else ("start",)
    last = "end" if done.asked.type == "speech" else done.asked.main
    since, until = done.time(*first), done.time(last)
    return None if since is None or until is None else (since, until, done)


def _attributed(case: Case, spans: Sequence[Span]) -> list[set[str]]:
    """The parts of each. Who names no hand has an arm that shows it and that nobody else has; else both."""
    used = [_parts(done) for _, _, done in spans]
    open_ = [
        (number, span)
        for type in ("pointing", "gesture")  # where a pointing goes is clearer
        for number, span in enumerate(spans)
        if span[2].asked.type == type and not span[2].asked.hand
    ]
    for number, (since, until, done) in open_:
        taken: set[str] = set()
        for other, parts in zip(spans, used, strict=True):
            if min(until, other[1]) - max(since, other[0]) > TOGETHER and other[2] is not done:
                taken |= parts
        shown = _sides_shown(case, done, since, until)
        free = [side for side in shown if f"{side} arm" not in taken]
        used[number] = {f"{side} arm" for side in (free[:1] or ARMS)}
    return used


def _sides_shown(case: Case, done: Done, since: float, until: float) -> list[str]:
    """The arms that have moved or are on target, the likeliest first: on target, then the longer way."""
    ways = {side: case.record.way(case.record.columns(*_arm(side)), since, until) for side in ARMS}
    on_target = dict.fromkeys(ARMS, False)
    entity = case.entity(done.asked.attributes.get("target", ""))
    if done.asked.type == "pointing" and entity is not None:
        rays = zip(ARMS, case.record.sample(until).arms, strict=True)
        on_target = {side: _beside(ray, entity.position) < POINTING_RADIUS + entity.radius for side, ray in rays}
    sides = [side for side in ARMS if on_target[side] or ways[side] > MOVED]
    return sorted(sides, key=lambda side: (on_target[side], ways[side]), reverse=True)


def _parts(done: Done) -> set[str]:
    """The parts that a behavior names; none for one that leaves the hand open."""
    type, hand = done.asked.type, done.asked.hand
    if type in ("pointing", "gesture"):
        return {f"{side} arm" for side in ARMS if hand in (side, "both")}
    return {PART_OF[type]} if type in PART_OF else set()


def _is_beneath(case: Case, span: Span) -> bool:
    """True for a shift of the eyes that begins under a look: it moves nothing until that ends."""
    return span[2].asked.type in ("gazeShift", "headDirectionShift") and _under_way(case, span[0], "gaze")


def _overlaid(one: Done, other: Done) -> bool:
    """True for a shift and what lies over it."""
    return (one.asked.type in SHIFTS) != (other.asked.type in SHIFTS)


# -- the end ---------------------------------------------------------------------------------------------------------


def home(case: Case) -> Iterator[Finding]:
    """Once everything has ended, arms and torso are where they belong, and nothing moves.

    They belong where they were in the beginning, or where a shift of the posture has left them.
    """
    record = case.record
    if case.story.lies or not record.samples or any(not record.ends.get(block) for block in case.blocks):
        return
    last = record.samples[-1]
    displaced = {each["joint"] for each in case.story.faults.get("displaced", [])}
    shifted = [each.times["end"] for each in case.done if each.asked.type in _POSED and "end" in each.times]
    is_hidden = any(_under_way(case, at, "posture", *WITH_STROKE) for at in shifted)
    """True if what a shift says was not to be seen at its end."""
    places = [record.samples[0], *map(record.sample, shifted)]
    parts = {f"{side} arm": _arm(side) for side in ARMS} | {"torso": TORSO}
    for part, joints in parts.items():
        columns = [each for each in record.columns(*joints) if record.joints[each] not in displaced]
        away = min(
            max(abs(last.joints[each] - place.joints[each]) for each in columns) if columns else 0.0
            for place in places
        )
        if away > 0.01 and not is_hidden:
            yield Finding("in the air", "", f"the {part} is {away:.2f} rad from where it belongs in the end")
    if last.is_moving:
        yield Finding("in the air", "", "something moves in the end")


# -- geometry --------------------------------------------------------------------------------------------------------


def _beside(ray: Ray, target: Vector) -> float:
    """Distance of a target from a ray, metres; from its origin, if the target lies behind."""
    way = [there - here for here, there in zip(ray.origin, target, strict=True)]
    along = sum(a * b for a, b in zip(way, ray.axis, strict=True))
    return math.dist(way, [max(along, 0.0) * each for each in ray.axis])


def _angle(ray: Ray, target: Vector) -> float:
    way = [there - here for here, there in zip(ray.origin, target, strict=True)]
    lengths = math.hypot(*way) * math.hypot(*ray.axis)
    cosine = sum(a * b for a, b in zip(way, ray.axis, strict=True)) / lengths
    return math.acos(max(-1.0, min(1.0, cosine)))


def _under_way(case: Case, at: float, *types: str) -> bool:
    """True if a behavior of these types is between its start and its end."""
    return any(
        done.asked.type in types
        and done.times.get("start", math.inf) <= at + TOGETHER
        and done.times.get("end", math.inf) >= at - TOGETHER
        for done in case.done
    )


def _torso(case: Case, at: float) -> str:
    """Words for the torso, if it may be the cause."""
    columns = case.record.columns(*TORSO)
    way = case.record.way(columns, at - 0.1, at)
    if way > 0.001:
        return ", while the torso turns"
    return ", with the torso turned" if case.record.away(columns, at) > 0.01 else ""
