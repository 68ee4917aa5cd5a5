"""Stuck instants: what does not come before what is held goes on, since it waits for it.

It is found from the marking, for one block. What is stuck in other blocks goes in, and what of this one is comes out,
so that what waits in one block for another waits for all that the other waits for.
"""

from collections import defaultdict
from collections.abc import Container, Iterable, Mapping, Sequence, Set
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.net.petri_net import PetriNet
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.plan.known import BLOCK_END, is_foreign
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import EPSILON, Member, Point, performer


def fixed_times(net: PetriNet) -> Mapping[int, Sequence[int]]:
    """For each instant, those that come at a fixed time before or after it."""
    found: dict[int, list[int]] = defaultdict(list)
    for place in net.places:
        if place.kind == "delay" and place.source:
            found[place.target].append(place.source)
            found[place.source].append(place.target)
    return found


class Stuck:
    """Instants that are stuck, given what is held, and what is stuck elsewhere.

    instants: they, and what comes after them. elsewhere: points of other blocks that are stuck. standing: those of
    them that come no nearer either: they will take as long as now once what is held goes on.
    """

    def __init__(
        self,
        plan: Plan,
        net: RunningNet,
        facts: Facts,
        elsewhere: Set[Point],
        standing: Set[Point],
        pauses: Container[Point],
        tied: Mapping[int, Sequence[int]],
    ) -> None:
        """pauses: gaps at which a voice can wait. tied: see `fixed_times`."""
        self._plan = plan
        self._net = net
        self._facts = facts
        self._elsewhere = elsewhere
        self._standing = standing
        self._pauses = pauses
        self._tied = tied
        self._silent = facts.silent
        self._running = self._later_than_moving(elsewhere - standing)
        """Instants that come nearer, since something that leads to them is on its way."""
        unfired = {each for each in range(len(plan.members)) if each not in net.fired}
        first = {each for each in unfired if any(map(self._is_held, plan.members[each]))}
        self.instants: Set[int] = frozenset()
        while first:
            self.instants = self._later(self.instants | first)
            first = {each for each in unfired - self.instants if self.keeps(each)}

    def keeps(self, transition: int) -> bool:
        """True if an instant has to wait for a behavior that is held: one of its own, or one that is tied to it.

        A behavior that waits for one that is held counts like that one. Of a behavior that comes at a fixed time
        after this instant, what it has yet to do before that counts.
        """
        members = self._plan.members[transition]
        if any(map(self._is_held, members)):
            return True
        kept = [member for member in members if self._can_be_kept(member)]
        if any(self._goes_to_held(each) or self._sets_out_in_vain(each) for each in kept):
            return True
        return bool(kept) and self._is_left_behind(transition, {member.behavior for member in members})

    def _is_left_behind(self, transition: int, but: Container[str]) -> bool:
        """True if a behavior that is stuck would be late for its fixed time before or after this instant."""
        tied = (other for each in self._tied.get(transition, ()) for other in self._plan.members[each])
        held = [other for other in tied if other.behavior not in but and self._is_stuck(other)]
        return any(self._sets_out(each) <= self._plan.schedule[transition] + EPSILON for each in held)

    def among(self, points: Iterable[Point]) -> Set[Point]:
        """Points of the block that are stuck, of these."""
        at = {point: self._plan.transition(point) for point in points if point not in self._facts.reached}
        here = [(point, transition) for point, transition in at.items() if transition in self.instants]
        return {
            point
            for point, transition in here
            if point == BLOCK_END or (transition is not None and self._waits_before(point.behavior, transition))
        }

    def running(self, points: Iterable[Point], running: Set[Point]) -> Set[Point]:
        """Points that come nearer, of these. running: those of other blocks that do."""
        at = {point: self._plan.transition(point) for point in points}
        later = self._later_than_moving(running)
        return {point for point, transition in at.items() if transition in later}

    def _later_than_moving(self, running: Set[Point]) -> Set[int]:
        """Instants after which something is on its way, in this block or in another."""
        facts, at = self._facts, self._plan.at
        moving = {at[each] for each in self._plan.foreign if not (each in facts.reached or each in self._elsewhere)}
        moving |= {at[each] for each in self._plan.foreign if each in running and each not in facts.reached}
        for behavior in facts.under_way:
            chain, number = self._plan.chains[behavior], facts.next_number(behavior)
            if not self._has_stopped(behavior) and not facts.holds(chain.points[number]):
                moving.add(at[chain.points[number]])
        fired = self._net.fired
        clocks = (each for each in self._plan.net.places if each.lag > 0.0 and each.kind != "phase")
        begun = {each.target for each in clocks if each.source in fired and each.target not in fired}
        found = self._plan.net.later(moving | {each for each in begun if self._net.ripe_at(each) < inf})
        while more := {each for here in found for each in self._tied.get(here, ())} - found:
            found = self._plan.net.later(found | more)
        return found

    # -- members of instants -------------------------------------------------------------------------------------

    def _is_held(self, member: Member) -> bool:
        if member.point in self._facts.reached:
            return False
        is_elsewhere = is_foreign(member.behavior)
        return member.point in self._elsewhere if is_elsewhere else self._facts.is_held(member.behavior)

    def _can_be_kept(self, member: Member) -> bool:
        """True if a behavior can be made to wait at an instant: before it begins, or where it holds."""
        if member.point in self._facts.reached or is_foreign(member.behavior):
            return False
        is_to_begin = member.kind == "start" and member.behavior not in self._facts.begun
        return is_to_begin or member.can_wait or member.point in self._pauses

    def _is_stuck(self, member: Member) -> bool:
        """True if a behavior has yet to pass its part, and its next point is stuck, or it waits for one before."""
        if member.point in self._facts.reached:
            return False
        if self._is_held(member):
            return True
        if (chain := self._plan.chains.get(member.behavior)) is None:
            return False  # It comes by itself: another block would have told.
        number, at = self._facts.next_number(member.behavior), self._plan.at
        is_next = number < len(chain.points) and at[chain.points[number]] in self.instants
        return is_next or self._waits_before(member.behavior, at[member.point])

    def _has_stopped(self, behavior: str) -> bool:
        """True if a behavior is held and comes no nearer to its next point: a clock, or a voice between words."""
        is_clock = performer(self._plan.chains[behavior].behavior) != "body"
        return behavior in self._silent or (is_clock and self._facts.is_held(behavior))

    def _sets_out(self, member: Member) -> Seconds:
        """Planned time of the next point of a behavior that is stuck; of another block, and if it stands, now."""
        if (chain := self._plan.chains.get(member.behavior)) is None or self._has_stopped(member.behavior):
            return -inf
        return self._plan.predicted(chain.points[self._facts.next_number(member.behavior)])

    def _goes_to_held(self, member: Member) -> bool:
        """True if a behavior cannot wait any more before an instant that is tied to a point of one that is held."""
        points = self._plan.chains[member.behavior].points
        for point in points[points.index(member.point) + 1 :]:
            here = self._plan.at[point]
            if any(other.behavior != member.behavior and self._is_stuck(other) for other in self._plan.members[here]):
                return True
            if self._is_left_behind(here, {member.behavior}):
                return True
            if self._net.part_of[point].can_wait or point in self._pauses:
                return False
        return False

    def _sets_out_in_vain(self, member: Member) -> bool:
        """True if a movement that begins would only wait before its stroke, for nobody knows how long."""
        chain = self._plan.chains[member.behavior]
        strokes = [number for number, point in enumerate(chain.points) if point.sync == "stroke"]
        if member.kind != "start" or not strokes or performer(chain.behavior) != "body":
            return False
        waits = [number for number in range(1, strokes[0]) if self._net.part_of[chain.points[number]].can_wait]
        for point in chain.points[waits[0] : strokes[0] + 1] if waits else ():
            here = self._plan.at[point]
            for each in (here, *self._tied.get(here, ())):
                others = (other for other in self._plan.members[each] if other.behavior != member.behavior)
                if any(self._is_standing(other, each) for other in others):
                    return True
        return False

    def _is_standing(self, member: Member, transition: int) -> bool:
        if is_foreign(member.behavior):
            return member.point in self._standing and member.point not in self._facts.reached
        return self._is_stuck(member) and transition not in self._running

    # -- what follows --------------------------------------------------------------------------------------------

    def _later(self, first: Set[int]) -> Set[int]:
        """Instants of `first`, and those that wait for them; what follows a behavior that goes on does not."""
        self.instants = found = self._plan.net.later(first, of_instants=True)
        series = [place for place in self._plan.net.places if place.after]
        while more := {each.target for each in series if self._waits_before(each.after, each.source)} - found:
            self.instants = found = self._plan.net.later(found | more, of_instants=True)
        return found

    def _waits_before(self, behavior: str, transition: int) -> bool:
        """True if a behavior does not pass an instant before what is held goes on."""
        if (chain := self._plan.chains.get(behavior)) is None:
            return transition in self.instants
        at, number = self._plan.at, self._facts.next_number(behavior)
        ahead = [point for point in chain.points[number:] if at[point] <= transition]
        if not ahead or self._facts.is_held(behavior):
            return bool(ahead)
        return any(at[point] in self.instants and self._can_be_kept(self._net.part_of[point]) for point in ahead)
