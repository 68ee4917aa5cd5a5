"""What the earliest schedule of a block is, found without nets, classes or topological order.

Every point is a variable of its own. Equalities are two inequalities; all inequalities are relaxed, one by one and
round after round, until nothing moves (Bellman-Ford). Also the random blocks that the planner is compared with.
"""

from collections.abc import Sequence
from itertools import pairwise

from hypothesis import strategies as st
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Behavior,
    BlockBehavior,
    Constraint,
    Gaze,
    Gesture,
    Head,
    Mark,
    Pointing,
    Posture,
    Speech,
    Synchronize,
    Timing,
    Wait,
)
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.references import SyncRef
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused

SEVEN = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
HOLDS = {
    "pointing": {"stroke_start", "stroke_end"},
    "gesture": {"stroke_start", "stroke_end"},
    "head": {"stroke_start", "stroke_end"},
    "gaze": {"stroke", "stroke_end", "relax"},
    "posture": {"ready", "stroke_start", "stroke", "stroke_end", "relax"},
    "wait": {"end"},
}
SECONDS = {
    "pointing": (0.5, 0.25, 0.5, 0.25, 0.25, 0.5),
    "gesture": (0.25, 0.25, 0.5, 0.25, 0.25, 0.5),
    "head": (0.25, 0.125, 0.25, 0.25, 0.0, 0.25),
    "gaze": (0.0, 0.0, 0.5, 0.0, 0.0, 0.5),
    "posture": (0.75, 0.0, 0.0, 0.0, 0.0, 0.5),
}
FASTEST, SLOWEST = 0.5, 1.25
"""Of a phase that is neither held nor rigid: times its natural duration."""


class Limits(Struct):
    """Of a phase: seconds. longest None: the behavior can wait at its end."""

    shortest: float
    natural: float
    longest: float | None


class Oracle(Struct):
    """What is known of the points of a block, as (one, other, seconds): other is no earlier than one + seconds.

    natural, extreme: with natural durations (who is to be on target is so just in time), or as short and long as can
    be. customs: what holds where nobody has said anything else: series of one type, and looks that last.
    """

    times: dict[str, float]
    natural: list[tuple[str, str, float]]
    extreme: list[tuple[str, str, float]]
    customs: list[tuple[str, str, float]]

    def earliest(self) -> dict[str, float] | None:
        """With natural durations; None if there is no such schedule."""
        return relaxed(self.times, self.natural + self.customs)

    def is_possible(self) -> bool:
        """Is there a schedule, with every phase as short or long as can be?"""
        return relaxed(self.times, self.extreme) is not None


def type_of(behavior: Behavior) -> str:
    return str(behavior.__struct_config__.tag)


def points_of(behavior: BlockBehavior) -> tuple[str, ...]:
    if isinstance(behavior, Speech):
        return ("start", *(mark.id for mark in behavior.marks), "end")
    return SEVEN if type_of(behavior) in SECONDS else ("start", "end")


def phases_of(behavior: BlockBehavior) -> list[Limits]:
    points, holds = points_of(behavior), HOLDS.get(type_of(behavior), set())
    if isinstance(behavior, Wait):
        return [Limits(behavior.duration or 0.0, behavior.duration or 0.0, None)]
    seconds = SECONDS.get(type_of(behavior), (1.0,) * (len(points) - 1))
    return [
        Limits(FASTEST * natural, natural, None if to in holds else SLOWEST * natural)
        for to, natural in zip(points[1:], seconds, strict=True)
    ]


def is_prompt(behavior: BlockBehavior, sync: str) -> bool:
    """Does it come there just in time if it can, and wait if it must?"""
    return sync == ("stroke" if type_of(behavior) == "gaze" else "ready") and type_of(behavior) in ("gaze", "posture")


def estimate(behavior: BlockBehavior) -> Estimate:
    """As a body would answer; every behavior has a part of its own."""
    phases = tuple(
        Phase(
            since=since, to=to, shortest=it.shortest, natural=it.natural, longest=it.longest, hold=it.longest is None
        )
        for (since, to), it in zip(pairwise(points_of(behavior)), phases_of(behavior), strict=True)
    )
    return Estimate(behavior=behavior.id, feasible=True, parts=(f"part of {behavior.id}",), phases=phases)


def estimated(block: Block) -> Plan | None:
    """The plan, None if it is refused."""
    try:
        return plan_block(block, [estimate(each) for each in block.behaviors])
    except BlockRefused:
        return None


def consult(block: Block) -> Oracle:
    """Everything the block says, and what behaviors are, as inequalities between single points."""
    times = {"0": 0.0}
    natural: list[tuple[str, str, float]] = []
    extreme: list[tuple[str, str, float]] = []

    def no_earlier(one: str, other: str, seconds: float) -> None:
        natural.append((one, other, seconds))
        extreme.append((one, other, seconds))

    for behavior in block.behaviors:
        names = [f"{behavior.id}:{sync}" for sync in points_of(behavior)]
        times |= dict.fromkeys(names, 0.0)
        for name in names:
            no_earlier("0", name, 0.0)
        for (since, to), phase in zip(pairwise(names), phases_of(behavior), strict=True):
            natural.append((since, to, phase.natural))
            extreme.append((since, to, phase.shortest))
            if phase.longest is not None:
                natural.append((to, since, -phase.natural))
                extreme.append((to, since, -phase.longest))
            elif is_prompt(behavior, to.rpartition(":")[2]):
                natural.append((to, since, -phase.natural))
        if type_of(behavior) == "gaze":
            no_earlier(f"{behavior.id}:ready", f"{behavior.id}:start", 0.0)
            no_earlier(f"{behavior.id}:stroke_start", f"{behavior.id}:ready", 0.0)
            no_earlier(f"{behavior.id}:stroke_start", f"{behavior.id}:start", 0.0)
        if type_of(behavior) in ("gaze", "posture"):
            no_earlier(f"{behavior.id}:relax", f"{behavior.id}:stroke_end", 0.0)
        if type_of(behavior) == "posture":
            no_earlier(f"{behavior.id}:stroke", f"{behavior.id}:ready", 0.0)
    for kind, one, others in said(block):
        ref, offset = point(one, block)
        for text in others:
            sync, other = point(text, block)
            if kind is not Before:
                no_earlier(ref, sync, offset - other)
            if kind is not After:
                no_earlier(sync, ref, other - offset)
    return Oracle(times, natural, extreme, customs(block))


def customs(block: Block) -> list[tuple[str, str, float]]:
    """Every behavior has a part of its own here, so that nothing takes another's place."""
    points = {
        name
        for kind, one, others in said(block)
        if kind is not Synchronize or len({one, *others}) > 1  # to be one with itself does not constrain a point
        for name in (point(text, block)[0] for text in (one, *others))
    }
    lasting = {
        each.id
        for each in block.behaviors
        if type_of(each) in ("gaze", "posture")
        and not {f"{each.id}:{sync}" for sync in ("stroke_end", "relax", "end")} & points
    }
    found = [
        (f"{other.id}:end", f"{id}:relax", 0.0)
        for id in lasting
        for other in block.behaviors
        if other.id not in lasting
    ]
    previous: dict[str, str] = {}
    for behavior in block.behaviors:
        before = previous.get(type_of(behavior))
        previous[type_of(behavior)] = behavior.id
        if before is not None and behavior.id not in placed(block):
            found.append((f"{before}:{'stroke' if before in lasting else 'end'}", f"{behavior.id}:start", 0.0))
    return found


def placed(block: Block) -> set[str]:
    """Behaviors of which it is said when they come: by their own timing, or as what a constraint speaks of."""
    found = {each.id for each in block.behaviors if each.timing}
    for constraint in block.constraints:
        for each in constraint.operators:
            ref, *others = (point(text, block)[0].partition(":")[0] for text in (each.ref, *each.syncs))
            if isinstance(each, Synchronize):
                found |= {ref, *others}
            else:
                found |= {ref if other == "0" else other for other in others}
    return found


def said(block: Block) -> list[tuple[type, str, tuple[str, ...]]]:
    found: list[tuple[type, str, tuple[str, ...]]] = []
    for constraint in block.constraints:
        found += [(type(each), each.ref, each.syncs) for each in constraint.operators]
    for behavior in block.behaviors:
        found += [(Synchronize, f"{behavior.id}:{each.sync}", (each.ref,)) for each in behavior.timing]
    return found


def point(text: str, block: Block) -> tuple[str, float]:
    ref = SyncRef.parse(text)
    if not ref.behavior:
        return "0", ref.offset
    behavior = next(each for each in block.behaviors if each.id == ref.behavior)
    ref = SyncRef.parse(text, [mark.id for mark in getattr(behavior, "marks", ())])
    return f"{ref.behavior}:{ref.sync}", ref.offset


def relaxed(start: dict[str, float], lags: Sequence[tuple[str, str, float]]) -> dict[str, float] | None:
    times = dict(start)
    for _ in range(len(times) + 1):
        moved = False
        for one, other, seconds in lags:
            if times[one] + seconds > times[other] + 1e-7:
                times[other] = times[one] + seconds
                moved = True
        if times["0"] > 0:
            return None
        if not moved:
            return times
    return None


OFFSETS = (-2.0, -1.0, -0.5, 0.0, 0.0, 0.0, 0.0, 0.25, 0.5, 1.0, 2.0)


@st.composite
def random_behaviors(draw: st.DrawFn, most: int = 30) -> tuple[BlockBehavior, ...]:
    size = draw(st.integers(1, most))
    kinds = draw(st.lists(st.sampled_from("gphdsswb"), min_size=size, max_size=size))
    return tuple(_behavior(kind, f"{kind}{number}") for number, kind in enumerate(kinds))


def _behavior(kind: str, id: str) -> BlockBehavior:
    match kind:
        case "g":
            return Gaze(id=id, target="a")
        case "p":
            return Pointing(id=id, target="a")
        case "h":
            return Head(id=id, lexeme="NOD")
        case "d":
            return Posture(id=id, lexeme="LEAN")
        case "w":
            return Wait(id=id, duration=0.75)
        case "b":
            return Gesture(id=id, lexeme="BEAT")
    return Speech(id=id, text="one two three", marks=(Mark("m-1", 4), Mark("m-2", 8)))


@st.composite
def random_blocks(draw: st.DrawFn, most: int = 30) -> Block:
    """Up to `most` behaviors with constraints of every kind; fixed durations and absolute times among them.

    Most cannot be performed as they are: something must be dropped, or all refused.
    """
    behaviors = list(draw(random_behaviors(most)))
    refs = [(each.id, sync) for each in behaviors for sync in points_of(each)]

    def ref() -> str:
        if draw(st.integers(0, 11)) == 0:
            return str(draw(st.sampled_from((0.5, 2.0, 5.0))))
        return _ref(*draw(st.sampled_from(refs)), draw(st.sampled_from(OFFSETS)))

    operators: list[Synchronize | After | Before] = []
    for _ in range(draw(st.integers(0, 12))):
        kind = draw(st.sampled_from((Synchronize, After, After, Before)))
        operators.append(kind(ref=ref(), syncs=tuple(ref() for _ in range(draw(st.integers(1, 2))))))
    for number, behavior in enumerate(behaviors):
        if draw(st.integers(0, 7)) == 0:
            since = draw(st.sampled_from((0.0, 0.5, 1.0, 3.0)))
            length = draw(st.sampled_from((0.75, 1.5, 2.0, 2.5, 6.0)))
            timing = (Timing("start", str(since)), Timing("end", str(since + length)))
            behaviors[number] = replace(behavior, timing=timing)
    return Block(id="b", behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))


@st.composite
def possible_blocks(draw: st.DrawFn, most: int = 30) -> Block:
    """Up to `most` behaviors, nearly always possible: each is tied to an earlier one by one point or bounded."""
    behaviors = list(draw(random_behaviors(most)))
    operators: list[Synchronize | After | Before] = []
    for number, behavior in enumerate(behaviors[1:], 1):
        kind = draw(st.sampled_from((None, None, Synchronize, After, Before)))
        other = behaviors[draw(st.integers(0, number - 1))]
        theirs = _ref(other.id, draw(st.sampled_from(points_of(other))), draw(st.sampled_from(OFFSETS)))
        if kind is Synchronize:
            own = draw(st.sampled_from(points_of(behavior)))
            operators.append(Synchronize(ref=theirs, syncs=(_ref(behavior.id, own, 0.0),)))
        elif kind is After:
            operators.append(After(ref=theirs, syncs=(f"{behavior.id}:start",)))
        elif kind is Before:
            operators.append(Before(ref=theirs, syncs=(f"{behavior.id}:start",)))
    return Block(id="b", behaviors=tuple(behaviors), constraints=(Constraint(operators=tuple(operators)),))


def _ref(behavior: str, sync: str, offset: float) -> str:
    return str(SyncRef(behavior=behavior, sync=sync, offset=offset))
