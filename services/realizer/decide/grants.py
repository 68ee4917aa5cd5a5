"""Grants: which behavior may begin, and how far each may go, given the marking of the net.

An instant is decided when nothing but behaviors on their way is missing there. Behaviors that are early hold; the
last to come is told to pass, and never stops. A behavior that cannot hold is kept back where it last can, so that by
prediction it comes on time. Only instants that something has changed for are looked at again.

Stuck is what does not come before what is held goes on, since it waits for it. That is found from the marking, for
one block. What is stuck in other blocks goes in, and what of this one is comes out, so that what waits in one block
for another waits for all that the other waits for.
"""

import heapq
from collections import defaultdict
from collections.abc import Callable, Container, Iterable, Mapping, Sequence, Set
from math import inf

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.expectations import Foresight
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.net.petri_net import PetriNet
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.plan.known import BLOCK_END, is_foreign
from engage_hri.services.realizer.plan.plan import BRAKING, UNNOTICED, Plan, slack
from engage_hri.services.realizer.points import EPSILON, WITH_STROKE, Member, Point, frozen, performer


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


LEAD: Seconds = 0.3
"""How long before an instant a behavior that comes just in time is told to pass it; more than braking takes. Ours."""
GAP: Seconds = 0.05
"""How long before a word gap an utterance is told to go on; more than a message takes. Later is better, since more is
known of the others then. Ours."""


class Grants(Observer):
    """Permissions to pass instants.

    touched: behaviors that may go further, or at another pace, than they were told. granted_at: when each behavior
    was last allowed to go further.
    """

    def __init__(
        self,
        facts: Facts,
        foresight: Foresight,
        is_free: Callable[[str], bool] = lambda behavior: True,
    ) -> None:
        """is_free: False for a behavior that is not to begin now, since another block has a part of it."""
        self.touched: set[str] = set()
        self.granted_at: dict[str, Seconds] = {}
        self._facts = facts
        self._foresight = foresight
        self._is_free = is_free
        self._through: dict[str, int] = {}
        """For each behavior, the number of the last point that it may go through."""

    def adopt(self, plan: Plan, net: RunningNet) -> None:
        """Decide about another plan from now on. What a behavior was told stays."""
        self._plan = plan
        self._net = net
        self.touched.clear()
        self._granted: set[tuple[int, str]] = set()
        self._wakes: list[tuple[Seconds, int]] = []
        self._dirty: set[int] = set()
        """Instants that something has changed for."""
        self._takes: dict[str, list[str]] = {}
        """Behaviors of the block that take parts of others by plan, and whose."""
        for id, (taker, _) in plan.successors.items():
            self._takes.setdefault(taker, []).append(id)
        self._pauses = _pauses(plan)
        self._tied = fixed_times(plan.net)
        self._known_stuck: tuple[object, Stuck] | None = None
        """What was stuck when it was asked last, after what had been the case by then."""

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_arrived(self, point: Point, at: Seconds) -> None:
        self._dirty.add(self._plan.at[point])

    def on_reached(self, point: Point, at: Seconds) -> None:
        self._dirty.add(self._plan.at[point])

    def on_opened(self, transition: int) -> None:
        self._dirty.add(transition)

    # -- what is to be decided -----------------------------------------------------------------------------------

    def look_again(self, behavior: str) -> None:
        """Look at the next point that the behavior was not told to pass.

        Only when it is under way can be told whether it comes on time there.
        """
        if (chain := self._plan.chains.get(behavior)) is not None:
            number = max(self._facts.next_number(behavior), self.through(behavior) + 1)
            if number < len(chain.points):
                self._dirty.add(self._plan.at[chain.points[number]])

    def moved(self, transition: int) -> None:
        """Decide again about an instant that is expected at another time than before."""
        if transition < len(self._plan.members):
            if self._net.is_open(transition):  # else it is decided when it opens
                self._dirty.add(transition)
            begun = self._facts.begun
            self.touched.update(each.behavior for each in self._plan.members[transition] if each.behavior in begun)

    @property
    def deadline(self) -> Seconds | None:
        """Time at which to `wake` even if nothing happens until then; None: there is no need."""
        return self._wakes[0][0] if self._wakes else None

    def wake(self, now: Seconds) -> None:
        """Take up the instants that are to be decided by `now`."""
        while self._wakes and self._wakes[0][0] <= now + EPSILON:
            self._dirty.add(heapq.heappop(self._wakes)[1])

    def take(self, *, only_measured: bool) -> list[int]:
        """The instants to be decided. only_measured: without those that it takes a forecast to decide."""
        if not self._dirty:
            return []
        taken = {each for each in self._dirty if not (only_measured and self._foresight.minds(each))}
        self._dirty -= taken
        return sorted(taken)

    # -- decisions -----------------------------------------------------------------------------------------------

    def decide(self, transition: int, now: Seconds) -> list[str]:
        """Decide about an instant; returns the behaviors that are to begin."""
        if not self._net.is_open(transition):
            return []
        members = self._plan.members[transition]
        if self._facts.is_holding and self.stuck(self._facts.stuck, self._facts.standing).keeps(transition):
            return []
        missing = [member for member in members if member.kind != "start" and not self._is_there(member)]
        may_pass = missing[0] if len(missing) == 1 and missing[0].can_wait else None
        ripe = max(self._facts.began, self._net.ripe_at(transition))
        # Where all are there, and no bound holds them back, what was measured says enough.
        due = self._foresight.due(transition, ripe) if missing or self._foresight.minds(transition) else ripe
        for member in missing:
            if member.point in self._pauses:
                self._decide_pause(transition, member, due, now)
        if due > now + EPSILON:
            self._wake(transition, due)
            arrival = None if may_pass is None else self._foresight.arrival(may_pass)
            # Who is alone there, and early by less than a stop costs, is slower on its way.
            is_foreseen = may_pass is not None and self._foresight.forecast is not None
            early = slack(self._plan, may_pass.point) if may_pass is not None and is_foreseen else 0.0
            if may_pass is not None and arrival is not None and arrival >= due - early - EPSILON:
                # Not told earlier than necessary: if the behavior is faster than expected, it must wait after all.
                if ripe - LEAD > now + EPSILON:
                    self._wake(transition, ripe - LEAD)
                else:
                    self._foresight.may_be_slower.add(may_pass.behavior)
                    self._grant(transition, may_pass)
            self._decide_together(transition, missing, due, now)
            return []
        if may_pass is not None:
            self._grant(transition, may_pass)
        self._decide_together(transition, missing, due, now)
        begun = self._facts.begun
        beginning = [each.behavior for each in members if each.kind == "start" and each.behavior not in begun]
        beginning = [each for each in beginning if not self._is_to_take(each, transition)]
        if missing or not all(self._is_free(each) for each in beginning):
            return []  # Where another block is in the way, it is planned again.
        for member in members:
            self._grant(transition, member)
        return beginning

    def _decide_together(self, transition: int, missing: list[Member], due: Seconds, now: Seconds) -> None:
        """Let those pass that are expected at one time: each of them is the last, and none has to stop.

        They are told when the first would brake, and not before: until then each waits for what the others do. Of a
        look nobody knows so well when it arrives.
        """
        if len(missing) < 2 or not all(each.can_wait for each in missing):
            return
        types = {self._plan.chains[each.behavior].type for each in missing}
        arrivals = [self._foresight.arrival(each) for each in missing]
        coming = [each for each in arrivals if each is not None]
        if not types <= WITH_STROKE or len(coming) < len(missing):
            return
        if max(coming) - min(coming) <= UNNOTICED and min(coming) >= due - UNNOTICED:
            if (told := min(coming) - BRAKING) > now + EPSILON:
                self._wake(transition, told)
            else:
                for each in missing:
                    self._grant(transition, each)

    def _is_to_take(self, behavior: str, transition: int) -> bool:
        """True if a behavior that begins here takes a part of another one that has yet to make what it has to here.

        By plan that takes no time, as it looks already where it is to look. But it has come only when it is measured.
        """
        points = [self._plan.kept[id] for id in self._takes.get(behavior, ())]
        return any(self._plan.at.get(each) == transition and each not in self._facts.reached for each in points)

    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Stuck:
        """Find what is stuck now, if these points of other blocks are; anew when anything has happened."""
        net, facts = self._net, self._facts
        theirs = frozenset(point for point in self._plan.foreign if point in elsewhere)
        firm = theirs & standing
        known = (len(facts.reached), len(facts.arrived), len(facts.begun), len(net.fired))
        state = (facts.held, theirs, firm, known, facts.silent)
        if self._known_stuck is None or self._known_stuck[0] != state:
            self._known_stuck = (state, Stuck(self._plan, net, facts, theirs, firm, self._pauses, self._tied))
        return self._known_stuck[1]

    def _is_there(self, member: Member) -> bool:
        can_wait = member.can_wait or member.point in self._pauses
        return member.point in self._facts.reached or (can_wait and member.point in self._facts.arrived)

    def _decide_pause(self, transition: int, member: Member, due: Seconds, now: Seconds) -> None:
        """Let an utterance through a word gap unless it would be noticeably early; it is told just before."""
        arrival = self._foresight.arrival(member)
        if arrival is None or (transition, member.behavior) in self._granted:
            return
        if arrival - GAP > now + EPSILON:
            self._wake(transition, arrival - GAP)
        elif due <= arrival + UNNOTICED:
            self._grant(transition, member)

    def _grant(self, transition: int, member: Member) -> None:
        if (transition, member.behavior) not in self._granted:
            self._granted.add((transition, member.behavior))
            self.touched.add(member.behavior)

    def _wake(self, transition: int, at: Seconds) -> None:
        heapq.heappush(self._wakes, (at, transition))

    # -- what was granted too early ------------------------------------------------------------------------------

    def revoke(self, behavior: str) -> Point | None:
        """Let a behavior under way ask again where it next can wait, if it was told to pass; returns that point."""
        points = self._plan.chains[behavior].points
        ahead = (self._net.part_of[point] for point in points[self._facts.next_number(behavior) :])
        member = next((member for member in ahead if member.can_wait), None)
        if member is None or (granted := (self._plan.at[member.point], behavior)) not in self._granted:
            return None
        self._granted.discard(granted)
        first = next(number for number, point in enumerate(points) if self._plan.at[point] == granted[0])
        self._through[behavior] = min(self.through(behavior), first - 1)
        return member.point

    # -- how far -------------------------------------------------------------------------------------------------

    def through(self, behavior: str) -> int:
        """Number of the last point that the behavior was last told to go through; -1: it was told nothing yet."""
        return self._through.get(behavior, -1)

    def extend(self, behavior: str, now: Seconds) -> int:
        """Number of the last point that the behavior may go through from now on; at least its start."""
        points = self._plan.chains[behavior].points
        known = furthest = self.through(behavior)
        for number in range(known + 1, len(points)):
            if not self.may_pass(points[number]):
                break
            furthest = number
        if furthest > known:
            self._through[behavior] = furthest
            self.granted_at[behavior] = now
        return max(0, furthest)

    def may_pass(self, point: Point) -> bool:
        """True if the behavior need not ask before it passes `point`."""
        if point in self._facts.reached or not (self._net.part_of[point].can_wait or point in self._pauses):
            return True
        return (self._plan.at[point], point.behavior) in self._granted


def _pauses(plan: Plan) -> frozenset[Point]:
    """Word gaps at which an utterance waits, so as not to be too early."""
    constrained = {place.target for place in plan.net.places if place.kind in ("order", "delay", "series")}
    found: set[Point] = set()
    for id, chain in plan.chains.items():
        if isinstance(chain.behavior, Speech) and (estimate := plan.estimates.get(id)) is not None:
            for phase in estimate.phases:
                gap, at = Point(id, phase.to), plan.at.get(Point(id, phase.to), 0)
                waits = at and plan.predicted(gap) - plan.predicted(Point(id, phase.since)) > phase.natural + EPSILON
                if phase.hold and (waits or at in constrained or len(plan.members[at]) > 1):
                    found.add(gap)
    return frozen(found)
