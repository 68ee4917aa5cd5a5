"""A block while it is planned: what is left of it, and what was given up for that.

Refused here: a block that lacks a required behavior. Dropped, each with a warning: behaviors that the body cannot do
or that cannot be on time, and those that need them. What a behavior was dropped for may be given up later: then it
comes back.
"""

from collections.abc import Collection, Iterable, Mapping

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Hand, Unknown
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.plan.handover import Conflict, Turn
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.losses import Loss, Times
from engage_hri.services.realizer.plan.part_order import PartOrder, SpeakingOrder
from engage_hri.services.realizer.plan.phases import Chain, chain
from engage_hri.services.realizer.plan.plan import Late, Manner
from engage_hri.services.realizer.plan.relations import (
    BlockRefused,
    Classes,
    Problem,
    Relations,
    as_dropped,
    at_line,
    relations_of,
)
from engage_hri.services.realizer.plan.remaining import falling, refused, remaining, unknown, untied, without
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import Point


class Draft:
    """What is left of a block. Parameters: see `plan_tries`."""

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

    def begin_anew(self) -> tuple[Relations, Classes]:
        """What the block says of the behaviors that are left, and their points; waits come from changed orders only.

        Raises BlockRefused: they contradict each other.
        """
        self.turns = self.parts.turns - self.overlaps
        said = untied(self.relations, self.untied) if self.untied else self.relations
        return remaining(said, self.chains, self.dropped, self.block.id)

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
