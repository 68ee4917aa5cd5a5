"""Rest of a block while it is planned: what is left of it, and what was given up for that.

Not performed are behaviors that nobody here knows, that the body refuses or that cannot be on time, each with a
warning; and those that mean nothing without others which are not performed (`Behavior.needs`). A block that lacks a
required behavior is refused. What the block says of dropped behaviors is taken out of its relations: else points that
never come would keep the others waiting. What a behavior was dropped for may be given up later: then it comes back.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from functools import partial
from typing import get_args

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Event, Hand, Head, Unknown
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.vocabulary import unperformed
from engage_hri.services.realizer.plan.assembly import Assembler
from engage_hri.services.realizer.plan.handover import Conflict, Turn
from engage_hri.services.realizer.plan.known import Known, is_foreign
from engage_hri.services.realizer.plan.losses import Loss, Times
from engage_hri.services.realizer.plan.part_order import PartOrder, SpeakingOrder
from engage_hri.services.realizer.plan.phases import Chain, chain, unawaited_events
from engage_hri.services.realizer.plan.plan import Late, Manner
from engage_hri.services.realizer.plan.relations import (
    BlockRefused,
    Classes,
    Equal,
    Order,
    Problem,
    Relations,
    Term,
    as_dropped,
    at_line,
    relations_of,
)
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import ORIGIN, Point, frozen


def without(needed: str) -> str:
    """Reason why a behavior is dropped that needs another one. needed: id of that."""
    return f"it needs {needed}, which is not performed"


def falling(chains: Mapping[str, Chain], lost: Iterable[str], begun: Container[str]) -> dict[str, str]:
    """Behaviors that fall because others are lost, each with the one that it needs. What has begun is finished."""
    needing: dict[str, list[str]] = {}
    for id, each in chains.items():
        for needed in each.behavior.needs if id not in begun else ():
            needing.setdefault(needed, []).append(id)
    found: dict[str, str] = {}
    todo = list(lost) if needing else []
    for needed in todo:  # it grows
        fresh = [id for id in needing.get(needed, ()) if id not in found]
        found |= dict.fromkeys(fresh, needed)
        todo += fresh
    return found


def events_needing(lost: str, block: Block) -> list[Event]:
    """Connection events of the block that need a behavior: they are withdrawn with it, even if they have begun."""
    return [each for each in block.behaviors if isinstance(each, Event) and lost in each.needs]


def unknown(behavior: Unknown) -> tuple[WarningKind, str]:
    """Kind and reason of the warning about a behavior that nobody here knows, or that does not say what to do."""
    if behavior.namespace:
        return "CUSTOM_BEHAVIOR_NOT_SUPPORTED", f"<{behavior.element}> is of namespace {behavior.namespace!r}"
    if behavior.lacks:
        return (
            "CANNOT_CREATE_BEHAVIOR",
            f"<{behavior.element}> has no {behavior.lacks}, so there is nothing to perform",
        )
    return "BEHAVIOR_TYPE_NOT_SUPPORTED", unperformed(behavior.element)


def kind_of(warning: str) -> WarningKind:
    """Kind of the warning that a body gives as the reason why it cannot do a behavior."""
    return warning if warning in get_args(WarningKind) else "CANNOT_CREATE_BEHAVIOR"  # type: ignore[return-value]


def refused(estimate: Estimate, block: str) -> tuple[WarningKind, str, str]:
    """Kind, reason and advice of the warning about a behavior that the body cannot do."""
    fault = estimate.fault or Fault(reason="the body cannot do it")
    return kind_of(estimate.warning), replace(fault, advice="").within(block, estimate.behavior), fault.advice


def remaining(
    relations: Relations, chains: Mapping[str, Chain], dropped: Container[str], block: str
) -> tuple[Relations, Classes]:
    """Relations of the behaviors that are not dropped, and the classes of their points.

    Raises BlockRefused: they contradict each other. block: its id.
    """

    def is_left(term: Term) -> bool:
        return term.point.behavior not in dropped

    timed = partial(_timed, chains)
    equals = [
        Equal(tuple(map(timed, kept)), equal.behavior)
        for equal in relations.equals
        if (kept := tuple(filter(is_left, equal.terms))) and (len(kept) > 1 or len(equal.terms) == 1)
    ]
    classes = _classes(chains, equals, block)
    equals += [equal for equal in _left_over(relations, chains, dropped) if classes.tie_if_possible(equal)]
    orders = [each for each in relations.orders if is_left(each.earlier) and is_left(each.later)]
    present = Relations(
        tuple(equals),
        tuple([Order(timed(each.earlier), timed(each.later), each.placed) for each in orders]),
        frozen(id for id in relations.required if id not in dropped),
        untied=relations.untied,
    )
    return present, classes


def untied(relations: Relations, points: Container[Point]) -> Relations:
    """The relations without what they say of these points of other blocks."""
    equals = [
        (equal, tuple([term for term in equal.terms if not _is_of_others(term, points)]))
        for equal in relations.equals
    ]
    orders = [
        each for each in relations.orders if not any(_is_of_others(end, points) for end in (each.earlier, each.later))
    ]
    given_up = [term.point for equal, left in equals if left != equal.terms for term in left]
    given_up += [end.point for each in {*relations.orders} - {*orders} for end in (each.earlier, each.later)]
    return replace(
        relations,
        equals=tuple([replace(equal, terms=left) for equal, left in equals if left == equal.terms or len(left) > 1]),
        orders=tuple(orders),
        untied=frozen(point for point in given_up if not is_foreign(point.behavior)),
    )


def _is_of_others(term: Term, points: Container[Point]) -> bool:
    return is_foreign(term.point.behavior) and term.point in points


def _left_over(relations: Relations, chains: Mapping[str, Chain], dropped: Container[str]) -> list[Equal]:
    """Ties through points of dropped behaviors: they stay, unless they could not have been kept."""
    timed = partial(_timed, chains)
    torn = [
        Equal(tuple(map(timed, equal.terms)))
        for equal in relations.equals
        if equal.behavior not in dropped  # a dropped behavior's own timing is dropped, too
        and any(term.point.behavior in dropped for term in equal.terms)
    ]
    through = Classes()
    for equal in sorted(torn, key=lambda equal: [term.text for term in equal.terms]):
        through.tie_if_possible(equal)
    survivors = {
        term.point: term
        for equal in torn
        for term in equal.terms
        if term.point != ORIGIN and term.point.behavior not in dropped
    }
    first: dict[Point, Term] = {}
    found = []
    for point, term in sorted(survivors.items()):
        through.add(point)  # Nothing is tied to it where that contradicts the rest.
        root, offset = through.find(point)
        here = replace(term, offset=-offset, stroke=0)
        if root in first:
            found.append(Equal((first[root], here)))
            continue
        first[root] = here
        if (at := through.at(point)) is not None:
            found.append(Equal((here, Term(ORIGIN, at - offset, term.text, term.line))))
    return found


def _timed(chains: Mapping[str, Chain], term: Term) -> Term:
    """The term of a later stroke: a point of its own if the body tells of it, otherwise an offset to stroke 1."""
    if term.stroke < 2 or (movement := chains.get(term.point.behavior)) is None:
        return term
    later = Point(term.point.behavior, f"{term.point.sync}:{term.stroke}")
    if later in movement.points:
        return replace(term, point=later, stroke=0)
    assert isinstance(movement.behavior, Head)
    strokes = next(each.natural for each in movement.segments if each.since == "stroke")
    share = (term.stroke - 1) / movement.behavior.repetition
    return replace(term, offset=term.offset + share * strokes, stroke=0)


def _classes(chains: Mapping[str, Chain], equals: Collection[Equal], block: str) -> Classes:
    classes = Classes()
    for each in chains.values():
        for syncs in TYPES[each.type].one_instant:
            classes.tie(Equal(tuple([Term(Point(each.behavior.id, sync), 0.0, sync) for sync in syncs])), "")
    for equal in equals:
        classes.tie(equal, block)
    return classes


class Draft:
    """Rest of a block: what is planned next, and what was given up so far. Parameters: see `plan_tries`."""

    def __init__(
        self,
        block: Block,
        estimates: Mapping[str, Estimate],
        dropped: Iterable[str],
        known: Known,
        turns: frozenset[Turn],
        manner: Manner,
    ) -> None:
        self.block = block
        self.estimates = estimates
        self.known = known
        self.manner = manner
        self.spelling = Spelling(block, known.blocks)
        self.lines = {behavior.id: behavior.line for behavior in block.behaviors}
        self.dropped = dict.fromkeys([*dropped, *(each.behavior for each in manner.lost)])
        """Behaviors in the order in which they were dropped; the values mean nothing."""
        self.depending: dict[str, tuple[Chain, Loss, Problem]] = {}
        """Dropped behaviors that may be on time after all if a speech gives up a time, with why they were dropped."""
        self.given_up: dict[str, dict[str, Problem]] = {}  # see `Plan`
        self.doubted: set[Point] = set()  # known points, not planned for when they came or are expected
        self.untied: set[Point] = set(known.untied)  # see `Plan`
        self.early: set[tuple[str, Point]] = set()  # see `Arrangement`
        self.customs: set[tuple[str, str]] = set()  # waits by mere custom for which there is no time
        self.waived: set[tuple[Point, Point]] = set()  # own and other, that wait for each other whatever is planned
        self.overlaps: set[Turn] = set()  # turns that there is no time to wait for
        self.pruned: set[Turn] = set()  # turns that were found to be needless, once
        self.turns = frozenset[Turn]()
        self.hands: dict[str, Hand] = {}
        self.late: Late = {}
        self.chains: dict[str, Chain] = {}
        self._left: tuple[set[Point], Relations, Assembler] | None = None
        """What `begin_anew` returns, with the ties that were given up by then; None: it is to be found anew."""
        self.relations = relations_of(block, known.blocks)
        self.problems = [*dict.fromkeys((*self.relations.problems, *manner.lost))]
        for behavior in block.behaviors:
            if behavior.id not in self.dropped:
                self._read(behavior)
        self._let_fall()
        if begun := sorted(known.begun & self.chains.keys(), key=lambda id: known.natural_end(self.chains[id])):
            # Who has begun comes first; neighbors come after the last of these to end.
            self.chains = {id: self.chains[id] for id in dict.fromkeys((*begun, *self.chains))}
        self.places = tuple(self.chains)
        self.speeches = {id for id, chain in self.chains.items() if chain.type == "speech"}
        self.order = SpeakingOrder([id for id in self.chains if id in self.speeches])
        self.parts = PartOrder(turns)

    def _read(self, behavior: BlockBehavior) -> None:
        if isinstance(behavior, Unknown):
            self._drop(behavior.id, *unknown(behavior))
        elif behavior.id in self.relations.unusable:
            self._refuse_if_required(behavior.id, "its timing names a sync point it does not have", "PARSING_FAILURE")
            self.dropped[behavior.id] = None
        elif (estimate := self.estimates.get(behavior.id)) and not estimate.feasible:
            kind, reason, advice = refused(estimate, self.block.id)
            self._refuse_if_required(behavior.id, reason, kind, advice)
            self._drop(behavior.id, kind, f"{reason} ({advice})" if advice else reason)
        else:
            self.chains[behavior.id] = chain(behavior, estimate)
            if estimate and estimate.degraded:
                self.problems.append(Problem("DEGRADED", at_line(behavior.line, estimate.degraded), behavior.id))

    def _refuse_if_required(self, id: str, reason: str, kind: WarningKind, advice: str = "") -> None:
        if id in self.relations.required:
            advice = "; ".join(filter(None, (advice, "it is required: without `required` it would be dropped")))
            fault = Fault(reason=reason, where=f"{self.block.id}: {id}", line=self.lines[id], advice=advice)
            raise BlockRefused(fault, kind)

    def _drop(self, id: str, kind: WarningKind, reason: str, advice: str = "", line: int = 0) -> None:
        self._refuse_if_required(id, reason, kind, advice)
        self.chains.pop(id, None)
        self.dropped[id] = None
        if futile := self.given_up.pop(id, None):
            self.problems = [each for each in self.problems if each not in futile.values()]
        self.problems.append(Problem(kind, at_line(line or self.lines[id], as_dropped(reason, advice)), id))

    def _let_fall(self) -> None:
        """Drop what needs a behavior that is dropped."""
        for id, needed in falling(self.chains, self.dropped, self.known.begun).items():
            fallen = self.chains[id]
            self._drop(id, "CANNOT_CREATE_BEHAVIOR", without(needed))
            if needed in self.depending:
                self.depending[id] = fallen, self.depending[needed][1], self.problems[-1]

    def begin_anew(self) -> tuple[Relations, Assembler]:
        """Return what the block says of the behaviors that are left, and their assembler.

        Waits for parts come from changed orders only. Raises BlockRefused: the relations contradict each other.
        """
        self.turns = self.parts.turns - self.overlaps
        if self._left is None or self._left[0] != self.untied:
            said = untied(self.relations, self.untied) if self.untied else self.relations
            present, classes = remaining(said, self.chains, self.dropped, self.block.id)
            waited_for = frozenset(self.chains) - unawaited_events(self.chains, present)
            self._left = {*self.untied}, present, Assembler(self.chains, present, classes, waited_for)
        return self._left[1:]

    def give_up(self, found: Iterable[Loss], present: Relations) -> None:
        """Give up what cannot be on time: a wait for the voice, a time of a speech, or else the behavior."""
        times = Times(self.relations, self.speeches)
        gone, losses, given_up = {*self.dropped}, list[Loss](), set[Point]()
        for loss in found:
            turn = loss.turn
            if turn and turn in self.turns and self._may_speak_at_once(turn[1].behavior, present):
                self.overlaps.add(turn)
            elif time := times.give_up(loss.points, loss.among, gone):
                given_up.add(time[0])
                self._keep_words(*time, loss.reason)
            else:
                gone.add(loss.behavior)
                losses.append(loss)
        self.relations = times.left
        self._take_back(given_up)
        for loss in losses:
            if given_up.isdisjoint(loss.among):
                self._lose(loss)
        self._let_fall()
        self.order.begin_anew(self.chains, is_retimed=bool(given_up))
        self.parts.begin_anew()
        self._left = None
        self.doubted.clear()  # What they were too late for may be gone.

    def _may_speak_at_once(self, id: str, present: Relations) -> bool:
        """True for an utterance that no constraint mentions: the voice decides whether it has to wait."""
        return id in self.speeches & self.chains.keys() and all(each.behavior != id for each in present.constrained)

    def _lose(self, loss: Loss) -> None:
        id = loss.behavior
        lost = self.chains[id]
        self._drop(id, "IMPOSSIBLE_TO_SCHEDULE", loss.reason, loss.advice, loss.line)
        if lost.type != "speech":
            self.depending[id] = lost, loss, self.problems[-1]

    def _take_back(self, given_up: Collection[Point]) -> None:
        """Take back what was dropped because of times that speeches have given up by now: it may be on time."""
        back = [id for id, (_, loss, _) in self.depending.items() if not loss.among.isdisjoint(given_up)]
        for id in back:
            self.chains[id], _, problem = self.depending.pop(id)
            self.problems.remove(problem)
            del self.dropped[id]
        if back:
            self.chains = {id: self.chains[id] for id in self.places if id in self.chains}

    def _keep_words(self, point: Point, said: str, reason: str) -> None:
        id = point.behavior
        reason = f"{reason}; {said} is given up, so that the words are said"
        self.problems.append(Problem("IMPOSSIBLE_TO_SCHEDULE", at_line(self.lines[id], reason), id))
        self.given_up.setdefault(id, {})[said] = self.problems[-1]

    def settle(self, conflict: Conflict) -> None:
        """Let one of two behaviors that want the same part use the other arm, or wait for its turn."""
        if conflict.hand is None:
            assert conflict.turn is not None
            self.turns |= {conflict.turn}
            return
        id, hand = conflict.hand
        self.hands[id] = hand
        self.chains[id] = chain(replace(self.chains[id].behavior, mode=hand), self.estimates.get(id))
