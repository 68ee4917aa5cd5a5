"""News of a block: feedback while it runs, in the words of its dialect, and its outcome.

Feedback of a block never goes back in time, and each thing that goes wrong is told once. The voice may never get to
report its end, so what it has said is kept with each word that it tells (`Spoken`).
"""

from collections.abc import Collection, Container, Iterable, Mapping
from math import inf
from typing import Literal, NamedTuple

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import dialect_sync
from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    Feedback,
    PlannedPoint,
    PredictionFeedback,
    SpokenText,
    SyncPointProgress,
    WarningFeedback,
    WarningKind,
)
from engage_hri.schemas.body import BehaviorOutcome
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.text import has_words
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.decide.decisions import Decisions, Late
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.plan import UNNOTICED, Broken, Plan
from engage_hri.services.realizer.plan.relations import DROPPED, at_line
from engage_hri.services.realizer.plan.words import Spelling, taken
from engage_hri.services.realizer.points import Point, as_told, frozen

AT_ONCE: Seconds = 0.1
"""Seconds within which a behavior begins after what it waited for; if later, it waited for something else, too."""


def waited_for(
    plan: Plan, behavior: str, times: Mapping[Point, Seconds], spelling: Spelling, *, is_past: bool
) -> str:
    """Say for whom a behavior waits before it begins, and for which part; empty: for nobody, or for more than that.

    times: of points, those of other blocks among them. is_past: it has begun.
    """
    start = plan.chains[behavior].points[0]
    if (began := times.get(start)) is None:
        return ""
    found = []
    for place in plan.net.places:
        if place.kind == "series" and place.after and (place.behavior, place.target) == (behavior, plan.at[start]):
            holder = plan.chains.get(place.after)
            held = plan.holders.get(place.after, ()) if holder is None else holder.parts
            parts = tuple(part for part in plan.chains[behavior].parts if part in held)
            until = next(each for each in plan.net.transitions[place.source].points if each.behavior == place.after)
            if parts and (at := times.get(until)) is not None and began - at <= AT_ONCE:
                verb: Literal["has", "had"] = "had" if is_past else "has"
                found.append((at, taken(place.after, parts, until, spelling, verb=verb)))
    return f"it {'waited' if is_past else 'waits'} for its turn: {max(found)[1]}" if found else ""


SKEW: Seconds = 0.1
"""Time by which a point may miss its instant before it is reported as LATE: below it people notice nothing."""
MOVED: Seconds = 0.008
"""Seconds; a prediction that moves by less, as something was measured, is not told again."""
PLANNED: Seconds = 0.002
"""The same for the predictions of another plan: they are no mere consequence of what was measured."""
ON_REQUEST = "stopped on request"
"""What ended a behavior or a block for which no other reason was given."""
AGAIN: Seconds = 0.001
"""Seconds between predictions, for each point that the last one told: the cost grows with their number."""


def moved_noticeably(old: Mapping[Point, Seconds], new: Mapping[Point, Seconds], noticeable: Seconds = MOVED) -> bool:
    """True if a point of `new` is not in `old`, or has moved by more than `noticeable`.

    Points that `new` lacks have been, or were dropped: other feedback says so.
    """
    return any(point not in old or abs(time - old[point]) > noticeable for point, time in new.items())


class News(NamedTuple):
    """A sync point that is yet to be told: in feedback, and to other blocks."""

    point: Point
    at: Seconds
    arrived: Seconds | None
    by_body: bool


class Reporter:
    """The feedback of one block. It never goes back in time: what is told late gets the time of the last message."""

    def __init__(self, bus: Bus, block: str, spelling: Spelling) -> None:
        self._bus = bus
        self._block = block
        self.spelling = spelling
        self._late: dict[tuple[Point, str], Seconds] = {}
        """Instants that were reported as late, and what the block says of them: seconds planned; inf: it came."""
        self._character = ""
        self._latest: Seconds = -inf
        """Time of the latest message; none after it has an earlier one."""
        self._told: dict[Point, Seconds] = {}
        """The last prediction of each point, in seconds from the block's start."""
        self._plan: Plan | None = None
        """The plan of which predictions were told last."""
        self._given_up: frozenset[tuple[str, str]] = frozen()
        """Times that speeches have given up, as the block says them, that were warned of."""
        self.not_before = 0.0
        """Earliest time for the next prediction."""

    def started(self, plan: Plan, began: Seconds) -> None:
        """Tell that the block has begun, when its points are expected, and the problems of its plan."""
        self._plan = plan
        self._given_up = frozen((id, said) for id, all in plan.given_up.items() for said in all)
        self._character = plan.block.character_id
        at = self._bus.stamp(self._no_earlier(began))
        self._say(BlockProgress(block=self._block, progress="start", at=at, character_id=self._character))
        self._predict(plan, began, {point: plan.predicted(point) for point in _points(plan)})
        for problem in plan.problems:
            self.warn(problem.kind, problem.message, problem.behavior)

    def expect(self, plan: Plan, began: Seconds, times: Mapping[Point, Seconds]) -> None:
        """Tell when the points still to come are expected, seconds from the block's start, if that is news."""
        ours = {point: times[point] for point in _points(plan) if point in times}
        self.not_before = self._bus.now() + AGAIN * len(ours)
        if moved_noticeably(self._told, ours, MOVED if plan is self._plan else PLANNED):
            self._predict(plan, began, ours)
        self._plan = plan

    def _predict(self, plan: Plan, began: Seconds, times: Mapping[Point, Seconds]) -> None:
        self._told.update(times)
        points = []
        for point, time in times.items():
            if (sync := self._spelled(point, plan)) is not None:
                type = plan.chains[point.behavior].type
                points.append(PlannedPoint(behavior=point.behavior, sync=sync, time=time, type=type))
        prediction = PredictionFeedback(
            block=self._block, points=tuple(points), at=self._bus.stamp(began), character_id=self._character
        )
        self._say(prediction)

    def reached(self, decisions: Decisions, point: Point, *, arrived: Seconds | None, by_body: bool) -> None:
        """Report a point, and how much later it was than the first of its instant, as measured."""
        plan, facts = decisions.plan, decisions.facts
        at = facts.reached[point]
        together = (facts.reached.get(member.point, at) for member in plan.members[plan.at[point]])
        skew = at - min(at, *together)
        if (sync := self._spelled(point, plan)) is not None:
            told = self._no_earlier(at)
            self._say(
                SyncPointProgress(
                    block=self._block,
                    behavior=point.behavior,
                    sync=sync,
                    at=self._bus.stamp(told),
                    time=told - decisions.began,
                    predicted=self._told.get(point, told - decisions.began),
                    arrived=None if arrived is None or arrived == at else arrived - decisions.began,
                    skew=skew,
                    source="body" if by_body else "clock",
                    character_id=self._character,
                )
            )
        self.compare(decisions, point)

    def compare(self, decisions: Decisions, point: Point) -> None:
        """Warn if a point, reached now, and those before it have not come as the block says; also one of another."""
        for broken in decisions.broken(point):
            self._broken(broken, "came", decisions.plan, decisions.facts.reached)

    def given_up(self, plan: Plan) -> None:
        """Warn of the times that speeches give up by a new plan: once of each."""
        told = {(id, said): problem for id, all in plan.given_up.items() for said, problem in sorted(all.items())}
        for each, problem in told.items():
            if each not in self._given_up:
                self.warn(problem.kind, problem.message, problem.behavior)
        self._given_up |= told.keys()

    def unkept(self, plan: Plan) -> None:
        """Warn of what the plan itself cannot keep: ties to points of other blocks that leave no time for it."""
        for broken in plan.broken:
            self._broken(broken, "is planned", plan, plan.times)

    def _broken(self, broken: Broken, verb: str, plan: Plan, times: Mapping[Point, Seconds]) -> None:
        """Warn of what is broken by more than is tolerated.

        At planning of each thing that is said of an instant; as it comes once, if that is later than was planned.
        times: of points that have come, or are planned.
        """
        is_past = verb == "came"
        if broken.seconds > (SKEW if is_past else UNNOTICED):
            point = broken.point
            late = point.behavior if broken.direction == "later" else ""
            why = waited_for(plan, late, times, self.spelling, is_past=is_past) if late in plan.chains else ""
            sync = self.spelling(point) if is_foreign(point.behavior) else self.spelling.sync(point)
            members = plan.members[plan.at[point]] if point in plan.at else ()
            instant = next((each.point for each in members if each.behavior == point.behavior), point)
            is_news = (instant, broken.said) not in self._late
            if is_past:
                planned = max([seconds for (at, _), seconds in self._late.items() if at == instant], default=-inf)
                is_news = broken.seconds > planned + SKEW
            if is_news:
                self._late[instant, broken.said] = inf if is_past else broken.seconds
                # What is said only of other blocks is no behavior of this one.
                behavior = "" if is_foreign(instant.behavior) else instant.behavior
                self.warn("LATE", broken.told(sync, verb, why), behavior)

    def overdue(self, decisions: Decisions, late: Late) -> None:
        """Warn that a behavior takes too long. How much too late it comes in the end is told when it comes."""
        line, sync = decisions.plan.chains[late.behavior].behavior.line, self.spelling.sync(late.point)
        self.warn("LATE", at_line(line, f"{sync} is {late.overdue:.1f} s overdue"), late.behavior)

    def warn(self, kind: WarningKind, message: str, behavior: str = "") -> None:
        warning = WarningFeedback(
            block=self._block,
            kind=kind,
            message=as_told(message),
            behavior=behavior,
            at=self._bus.stamp(self._no_earlier(self._bus.now())),
            character_id=self._character,
        )
        self._say(warning)

    def interrupted(self, behavior: str, spoken: SpokenText | None, reason: str) -> None:
        """Warn that a behavior was ended for a reason (none: on request), and after which words."""
        said = f", after {spoken.text!r}" if spoken is not None else ""
        self.warn("INTERRUPTED", f"{reason or ON_REQUEST}{said}", behavior)

    def ended(self, status: str, began: Seconds) -> None:
        now = self._no_earlier(self._bus.now())
        progress = BlockProgress(
            block=self._block,
            progress="end",
            at=self._bus.stamp(now),
            time=now - began,
            status=status,  # type: ignore[arg-type]
            character_id=self._character,
        )
        self._say(progress)

    def _no_earlier(self, at: Seconds) -> Seconds:
        """`at`, or the time of the latest message if that is later; the next message is no earlier than this."""
        self._latest = max(self._latest, at)
        return self._latest

    def _say(self, feedback: Feedback) -> None:
        self._bus.publish(keys.FEEDBACK, feedback)

    def _spelled(self, point: Point, plan: Plan) -> str | None:
        """The point's name in the block's dialect; None if feedback does not tell it: no default point there."""
        if point.sync.startswith("stroke:"):
            return None
        return dialect_sync(point.sync, plan.chains[point.behavior].type, plan.block.dialect)


def _points(plan: Plan) -> Iterable[Point]:
    return (point for chain in plan.chains.values() for point in chain.points)


class Spoken:
    """Words that have been said so far. behaviors: all of the block."""

    def __init__(self, behaviors: Iterable[BlockBehavior]) -> None:
        self._speeches = {each.id: each for each in behaviors if isinstance(each, Speech)}
        self._position: dict[str, int] = {}
        """Characters said of each speech that has begun."""
        self._texts: dict[str, SpokenText] = {}

    def reach(self, point: Point) -> None:
        """Take a sync point that was passed: all before a mark has been said."""
        if (speech := self._speeches.get(point.behavior)) is not None:
            self.hear(speech.id, next((mark.position for mark in speech.marks if mark.id == point.sync), 0))

    def hear(self, id: str, position: int) -> None:
        """Take a position in a speech: all before it has been said. Reports on other behaviors are ignored."""
        if id in self._speeches:
            self._position[id] = max(position, self._position.get(id, 0))

    def end(self, outcome: BehaviorOutcome) -> None:
        """Take the outcome of a speech: the voice itself tells what it has said."""
        if (speech := self._speeches.get(outcome.behavior)) is not None:
            is_done = outcome.status == "done"
            text = speech.text if is_done else outcome.spoken or speech.text[: self._position.get(speech.id, 0)]
            self._texts[speech.id] = _told(speech, text)

    def of(self, id: str) -> SpokenText | None:
        """Words of a speech that have been said; None if it has not begun."""
        if id in self._texts or id not in self._position:
            return self._texts.get(id)
        return _told(self._speeches[id], self._speeches[id].text[: self._position[id]])

    @property
    def texts(self) -> tuple[SpokenText, ...]:
        """Words that have been said of each speech that has begun, in document order."""
        return tuple(text for id in self._speeches if (text := self.of(id)) is not None)


def _told(speech: Speech, text: str) -> SpokenText:
    return SpokenText(behavior=speech.id, text=text, complete=not has_words(speech.text.removeprefix(text)))


_BEHAVIORS = ("BEHAVIOR_TYPE_NOT_SUPPORTED", "CUSTOM_BEHAVIOR_NOT_SUPPORTED")
"""Kinds of the notes about behaviors without an id, which no list of a block's behaviors has."""


def completed(
    ended: BlockOutcome,
    block: Block,
    spoken: tuple[SpokenText, ...],
    lost: Mapping[str, str],
    interrupted: Collection[str],
    loss: Fault,
) -> BlockOutcome:
    """Complete the outcome of a block. One that had behaviors, each of which was dropped, has failed.

    ended: how it ended. lost: behaviors that did not come to their end, each with the reason. interrupted: those of
    them that were ended on request, which is no failure. loss: the fault of one that was lost.
    """
    dropped = {id: why for id, why in lost.items() if id not in interrupted}
    nothing = _nothing_performed(block, dropped, ended.block, loss) if ended.status == "done" else None
    return replace(
        ended,
        status="failed" if nothing else ended.status,
        fault=nothing or ended.fault,
        spoken=spoken,
        dropped=tuple(dropped),
        reasons=tuple(map(as_told, dropped.values())),
        interrupted=tuple([id for id in lost if id in interrupted]),
    )


def nothing_is_left(block: Block, dropped: Container[str]) -> bool:
    """True if the block had behaviors, and each of them was dropped."""
    had_any = bool(block.behaviors) or any(each.kind in _BEHAVIORS for each in block.unread)
    return had_any and all(behavior.id in dropped for behavior in block.behaviors)


def _nothing_performed(block: Block, dropped: Mapping[str, str], id: str, loss: Fault) -> Fault | None:
    """Fault of a block of whose behaviors each was dropped; None if it had none, or another is left. id: of it."""
    if not nothing_is_left(block, dropped):
        return None
    left_out = [each.message for each in block.unread if each.kind in _BEHAVIORS]
    whys = [*(f"{id}: {why.removeprefix(f'{id}: ')}" if why else id for id, why in dropped.items()), *left_out]
    reason = as_told(f"no behavior of it came to its end ({'; '.join(whys)})")
    return replace(loss, reason=reason, where=id, line=0, advice="")


def reasons(plan: Plan) -> dict[str, str]:
    """Behaviors that a plan has dropped, each with the reason."""
    why = {each.behavior: each.message.partition(DROPPED)[0] for each in reversed(plan.problems)}
    return {id: why.get(id, "") for id in plan.dropped}
