"""Agreement of a plan with what the body says about it: each answer may make another plan, with another answer.

A plan is made with what the body promises of each phase: its natural time, and how short and how long it can be.
What a phase takes in truth depends on how the behavior comes to it, so on the plan. The body rehearses each plan, and
its answer is what the next plan is made with. Two things can happen.

- They agree: the answer is what the plan was made with. The body can keep this plan.
- They never agree: each answer makes the plan that calls for the other. Then what each plan comes to is computed from
  the answer to it (`as_told`), and with it what that plan would miss.

The search goes from later to faster, from there to told late, and from there to dropped. The net lets behaviors wait
and dawdle before any hurries (`predict`). If the best plan misses what the block says, the block is planned in the
next manner (`Manner`): times may be missed by as little as can be, then behaviors also stand before they hurry. Of
all plans in all manners the one is taken that misses least, where the doubt that is left counts as missed. It is told
LATE before anything moves. A behavior is dropped only if the first promise left no time for it, or if there is no
such plan.

Asked about a plan are the poses in which behaviors start, and when they begin, wait and hurry (`planned_times`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.body import BodyPose, Estimate, EstimateBehaviors, Phase, PlannedTime
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Place, order
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.known import NOTHING, Known, is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.plan import AT_EASE, UNNOTICED, Broken, Manner, Plan, broken_by, slack
from engage_hri.services.realizer.points import EPSILON, SHIFTS, WITH_STROKE, Point, Segment, family, frozen

NOTICEABLE: Seconds = 0.0005
"""Seconds by which a phase may differ before it makes another plan."""

APART: Seconds = 2e-6
"""Seconds after all else has ended: a look that lasts so long goes home then, and not together with it."""
CUT: Seconds = 1.0
"""Seconds after it has been cut: a behavior that is to be cut at a hold point is never let go there."""


def poses_before(plan: Plan, known: Known = NOTHING) -> dict[str, BodyPose]:
    """Poses in which behaviors start that take another's place, by their ids: on the target of the earlier one.

    How long a look takes depends on what was looked at before it, not on where the head is as the block comes in.
    known: other live blocks; the earlier one may be of any of them.
    """
    latest: dict[str, tuple[Chain, Estimate]] = {}
    base: BodyPose | None = None
    """Pose to which a look goes home, once a shift has been made."""
    poses = {}
    times = {
        **known.points,
        **{point: plan.predicted(point) for each in plan.chains.values() for point in each.points},
    }
    users = {name: (each.chain, each.estimate) for name, each in known.holders.items()}
    users |= {id: (each, plan.estimates.get(id)) for id, each in plan.chains.items()}
    ranked = [*known.holders, *plan.begun_in_order(plan.chains)]
    for id in sorted(ranked, key=lambda id: round(times[users[id][0].points[0]], 6)):
        chain, estimate = users[id]
        is_shift, is_ours = chain.type in SHIFTS, id in plan.chains
        for part in chain.parts:
            earlier, before = latest.get(part, (None, None))
            if is_ours and earlier is not None and before is not None and before.pose_after is not None:
                if not _is_home(times, earlier, chain):
                    poses[id] = before.pose_after
                elif base is not None and family(chain.type) == "gaze":
                    poses[id] = base
                elif is_foreign(earlier.points[0].behavior) and before.pose_end is not None:
                    poses[id] = before.pose_end  # Now it may still be elsewhere: the body rehearses this block only.
            if estimate is not None and not (is_shift and is_ours and _is_overlaid(plan, id)):
                latest[part] = chain, estimate
        if is_shift and is_ours and estimate is not None:
            base = estimate.pose_after
    return poses


def planned_times(plan: Plan, known: Known = NOTHING) -> dict[str, tuple[PlannedTime, ...]]:
    """Times at which behaviors begin, wait, hurry and dawdle, by their ids, in the order in which they begin.

    Empty if no behavior makes a difference to another or to itself: then its first estimates hold. known: other live
    blocks.
    """
    order = plan.begun_in_order(plan.chains)
    order.sort(key=lambda id: round(plan.predicted(plan.chains[id].points[0]), 6))
    moving = [id for id in order if (estimate := plan.estimates.get(id)) is not None and estimate.parts]
    times = {
        id: behavior_times(plan, id, known, plan.predicted) for id in moving if plan.estimates[id].parts != ("voice",)
    }
    used = [part for id in times for part in plan.estimates[id].parts]
    used += [part for each in known.holders.values() for part in each.chain.parts]
    if len(set(used)) == len(used) and "torso" not in used and all(len(each) == 1 for each in times.values()):
        return {}
    return times


def behavior_times(
    plan: Plan, id: str, known: Known, at: Callable[[Point], Seconds], reached: int = 0
) -> tuple[PlannedTime, ...]:
    """Times of the points that a behavior has reached; then those at which it begins, waits, hurries and dawdles.

    at: when a point of the plan comes, or came. reached: number of the behavior's points that have been.
    """
    chain = plan.chains[id]
    times = [PlannedTime(sync=point.sync, at=at(point)) for point in chain.points[: max(1, reached)]]
    taken, (_, cut) = _taken(plan, id, at), plan.successors.get(id, ("", None))
    is_lost = False
    left = max(0, reached - 1)
    for (since, to), segment in list(zip(pairwise(chain.points), chain.segments, strict=True))[left:]:
        is_lost = is_lost or to == cut
        begins, comes = at(since), at(to)
        surplus = comes - begins - segment.natural
        if segment.hold and is_lost:  # It may not pass: it waits there until it is cut.
            times.append(PlannedTime(sync=to.sync, at=taken + CUT))
            break
        if to == cut and surplus < -NOTICEABLE:
            break
        is_just_in_time = chain.type in SHIFTS and comes >= taken - EPSILON
        is_due = _is_met_there(plan, to, known, begins, at) if segment.hold else is_just_in_time
        is_due = is_due and not (plan.at[since] == plan.at[to] and times[-1].sync == since.sync)
        if abs(surplus) > NOTICEABLE or is_due:
            is_slower = EPSILON < surplus <= slack(plan, to)
            when = comes + (APART if id in plan.natural else 0.0)
            times.append(PlannedTime(sync=to.sync, at=when, through=is_slower))
    return tuple(times)


def _is_met_there(plan: Plan, hold: Point, known: Known, before: Seconds, at: Callable[[Point], Seconds]) -> bool:
    """True if one comes to this instant who cannot wait, or if this waits for one that comes at the same time.

    Who is at the hold point waits until that is measured. before: when it is at the point before. If a point of
    another block has come by then, it need not stop for it.
    """
    here, net = plan.at[hold], plan.net
    others = (
        each
        for each in plan.members[here]
        if each.behavior != hold.behavior
        and (each.kind == "passive" or (each.kind == "prompt" and plan.chains[each.behavior].type not in WITH_STROKE))
    )
    if any(known.points.get(each.point, inf) > before for each in others):
        return True
    awaited = (net.places[each] for each in net.inputs[here])
    sources = {each.source for each in awaited if each.kind not in ("phase", "idle") and each.source}
    return any(at(point) > at(hold) - UNNOTICED for each in sources for point in net.transitions[each].points[:1])


def _taken(plan: Plan, id: str, at: Callable[[Point], Seconds]) -> Seconds:
    """Time at which another takes a part of this behavior. A shift takes nothing from what lies over it."""
    is_shift = plan.chains[id].type in SHIFTS
    begun, parts = at(plan.chains[id].points[0]), set(plan.chains[id].parts)
    later = plan.entering[plan.entering.index(id) + 1 :]
    rivals = [plan.chains[each] for each in later if is_shift or plan.chains[each].type not in SHIFTS]
    starts = [at(each.points[0]) for each in rivals if parts & set(each.parts)]
    if id in plan.successors and is_foreign(successor := plan.successors[id][0]):
        starts.append(at(Point(successor, "start")))
    return min((start for start in starts if start >= begun), default=inf)


def _is_overlaid(plan: Plan, shift: str) -> bool:
    """True if the shift has no time to move the head, since a gaze has it or takes it."""
    since, to = (plan.predicted(point) for point in plan.chains[shift].points)
    return to < since + EPSILON


def _is_home(times: Mapping[Point, Seconds], earlier: Chain, later: Chain) -> bool:
    """True if the earlier had the time to take its part home. A shift leaves it where it is."""
    if earlier.type in SHIFTS:
        return False
    relax, end = (times[point] for point in earlier.points[-2:])
    return relax + EPSILON < end <= times[later.points[0]] + EPSILON


def as_told(plan: Plan, told: Sequence[Estimate]) -> Plan:
    """The plan with what it misses if its phases take as long as the body told, and all that waits for them waits.

    Whoever performs it tries to be on time all the same.
    """
    times = _times(plan, {(each.behavior, phase.to): phase for each in told for phase in each.phases})
    missed = [each for each in broken_by(plan.relations, times) if not _is_foreign(each)]
    late = {(plan.at[each.late], plan.at[each.early]): each.seconds for each in missed}
    return replace(plan, late=late, broken=(*filter(_is_foreign, plan.broken), *missed))


def _times(plan: Plan, told: Mapping[tuple[str, str], Phase]) -> dict[Point, Seconds]:
    """Time at which each point comes. told: phases, by behavior and sync point.

    A behavior hurries and dawdles where it is planned to, as far as the body can, and waits at its hold points. No
    instant is earlier than planned; what passes of itself may be.
    """
    into: dict[int, list[Place]] = {}
    for place in plan.net.places:
        if place.kind not in ("idle", "phase"):
            into.setdefault(place.target, []).append(place)
    coming: dict[int, list[tuple[Chain, int]]] = {}
    for chain in plan.chains.values():
        for number, point in enumerate(chain.points):
            coming.setdefault(plan.at[point], []).append((chain, number))
    times, instants = plan.times, list(plan.schedule)
    for here in order(plan.net) or range(len(instants)):
        planned = plan.schedule[here]
        instants[here] = max([planned, *(instants[each.source] + each.lag for each in into.get(here, ()))])
        for chain, number in coming.get(here, ()):
            point, before = chain.points[number], chain.points[max(0, number - 1)]
            phase = told.get((point.behavior, point.sync))
            if phase is not None and plan.at[before] != here and not _is_cut(plan, point):
                segment = chain.segments[number - 1]
                is_paced = abs(planned - plan.predicted(before) - segment.natural) > NOTICEABLE
                times[point] = times[before] + (
                    _lasting(phase, segment, planned - times[before]) if is_paced else phase.natural
                )
                instants[here] = max(instants[here], times[point])
        for chain, number in coming.get(here, ()):
            if not number or chain.segments[number - 1].hold or plan.at[chain.points[number - 1]] == here:
                times[chain.points[number]] = instants[here]
    return times


def _is_cut(plan: Plan, point: Point) -> bool:
    """True if another takes the part of the behavior before this point, or at it."""
    cut = plan.successors.get(point.behavior, ("", None))[1]
    points = plan.chains[point.behavior].points
    return cut is not None and points.index(point) >= points.index(cut)


def _lasting(phase: Phase, segment: Segment, asked: Seconds) -> Seconds:
    """Seconds that a phase takes if it is asked to take `asked`: what was too short in an earlier answer still is."""
    shortest = max(phase.shortest, min(segment.shortest, phase.natural))
    return min(max(asked, shortest), inf if phase.longest is None else phase.longest)


def _is_foreign(broken: Broken) -> bool:
    return is_foreign(broken.early.behavior) or is_foreign(broken.late.behavior)


STRAIGHT, MOST = 2, 12
"""How often the body is asked about a plan anew. After the first so many times estimates go half-way only; at most,
in all."""

SURE = 3
"""An answer that the body has given so often in a row is taken as it is."""


class Rounds:
    """Plans of one block, and what the body has said about them.

    estimates: those to plan with next. turns: those that the next plan is to begin with: where two orders on one part
    each call for the other, what waited in one plan waits in all. manner: that of the next plan.
    """

    def __init__(self, question: EstimateBehaviors, first: tuple[Estimate, ...]) -> None:
        self.manner = AT_EASE
        self._tried: list[tuple[Seconds, Plan]] = []
        """Plans as the body would perform them: what each misses, and by how much the body may still err."""
        self._begin(question, first)
        self._first = question, first
        self._believing: Plan | None = None
        """The first plan: it believes all that the body has promised."""
        self._refuted: set[Point] = set()
        """Hold points behind which a phase took longer than the body had promised."""
        self._is_resigned = False

    def _begin(self, question: EstimateBehaviors, first: tuple[Estimate, ...]) -> None:
        self.estimates = first
        self.turns: frozenset[Turn] = frozenset()
        self._rounds = [(question, first, first)]
        """For each answer: the question, with what the plan was made, and what the body said."""
        self._begun = len(self._tried)
        """Number of plans that were tried in other manners."""
        self._has_jumped = False
        self._is_free = False

    def answer(self, question: EstimateBehaviors) -> tuple[Estimate, ...] | None:
        """Answer of the body to the same question before; None if it was not asked that."""
        return next((told for asked, _, told in self._rounds if asked == question), None)

    def let_go(self) -> None:
        """Insist on no order of behaviors any more: it leaves no time."""
        self.turns, self._is_free = frozenset(), True

    def close(self, plan: Plan, question: EstimateBehaviors, told: tuple[Estimate, ...]) -> Plan | None:
        """Compare what the body has told with what the plan was made with; returns the plan to perform.

        None: plan once more, with `estimates`.
        """
        tried = self._tried[self._begun :]
        if self.turns and tried and len(plan.dropped) > len(min(tried, key=_badness)[1].dropped):
            self.let_go()
            return None
        self._believing = self._believing or plan
        off = difference(self.estimates, told)
        off = off._replace(natural=max(off.natural, _too_slow(plan, told)))
        if len(plan.dropped) > len(self._believing.dropped) and not self._is_resigned:
            return self.give_way()
        is_agreed = max(off) <= NOTICEABLE
        outcome = plan if is_agreed else as_told(plan, told)
        self._tried.append((outcome.lateness + max(off), outcome))
        if is_agreed or len(self._rounds) > MOST:
            best = outcome if is_agreed else min(self._tried[self._begun :], key=_badness)[1]
            return best if self._is_resigned or best.lateness <= UNNOTICED else self.give_way()
        self._refuted.update(_refuted(plan, self.estimates, told))
        # The same question again: its answer is tried once as it is.
        is_settled = self._rounds[-1][0] == question and not self._has_jumped
        is_early = len(self._rounds) < STRAIGHT + 1
        self._has_jumped = self._has_jumped or (is_settled and not is_early)
        if not self._is_free and not is_early:
            self.turns |= plan.turns
        earlier = [(made_with, said) for _, made_with, said in self._rounds[1 - SURE :]]
        self._rounds.append((question, self.estimates, told))
        self.estimates = between(self.estimates, told, 1.0 if is_settled or is_early else 0.5, earlier)
        return None

    @property
    def can_give_way(self) -> bool:
        """True if there is anything but a refusal left where a plan is impossible."""
        return self._believing is not None and not self._is_resigned

    def give_way(self) -> Plan | None:
        """Plan in the next manner: what was promised cannot be kept in this one. Returns the plan to take if none is
        left: the one that misses least."""
        stands, first = frozen(self._refuted), self._believing
        assert first is not None
        if not self.manner.may_be_late:
            lost = tuple([each for each in first.problems if each.behavior in first.dropped])
            self.manner = Manner(may_be_late=True, lost=lost)
        elif stands - self.manner.stands and not self.manner.stands:
            self.manner = replace(self.manner, stands=stands)
        elif self._tried:
            return min(self._tried, key=_badness)[1]
        else:
            self.manner, self._is_resigned = AT_EASE, True
        self._begin(*self._first)
        return None


def _badness(tried: tuple[Seconds, Plan]) -> Seconds:
    return tried[0]


def _refuted(plan: Plan, before: Sequence[Estimate], after: Sequence[Estimate]) -> Iterator[Point]:
    """Hold points behind which a phase cannot be as short as was thought."""
    known = {(each.behavior, phase.to): phase.shortest for each in before for phase in each.phases}
    for each in after:
        chain = plan.chains.get(each.behavior)
        for number, phase in enumerate(each.phases if chain is not None else ()):
            if phase.shortest > known.get((each.behavior, phase.to), inf) + NOTICEABLE:
                holds = [earlier.to for earlier in each.phases[:number] if earlier.hold]
                yield from (Point(each.behavior, sync) for sync in holds[-1:])


def _too_slow(plan: Plan, told: Sequence[Estimate]) -> Seconds:
    """Seconds by which a phase is planned to take longer than the body says it can, at most.

    Who waits at its end may take any time.
    """
    found = [0.0]
    for each in told:
        for phase in each.phases if each.behavior in plan.chains else ():
            end = Point(each.behavior, phase.to)
            seconds = plan.predicted(end) - plan.predicted(Point(each.behavior, phase.since))
            waits = any(it.behavior == each.behavior and it.can_wait for it in plan.members[plan.at[end]])
            if phase.longest is not None and not (waits and seconds - phase.natural > slack(plan, end)):
                found.append(seconds - phase.longest)
    return max(found)


class Difference(NamedTuple):
    """Seconds by which phases are other than expected, at most; inf if something else is. short: by which they take
    longer, at their shortest."""

    natural: Seconds
    short: Seconds


def difference(before: Sequence[Estimate], after: Sequence[Estimate]) -> Difference:
    """The greatest difference between the estimates of a plan, `before`, and those that it calls for.

    Estimates of what was not asked about say nothing: bodies err. Nor do those of what the plan leaves out.
    """
    known = {each.behavior: each for each in before if each.feasible}
    found = [_difference(known[each.behavior], each) for each in after if each.behavior in known]
    return Difference(
        max((each.natural for each in found), default=0.0), max((each.short for each in found), default=0.0)
    )


def _difference(one: Estimate, other: Estimate) -> Difference:
    phases = [each.to for each in one.phases], [each.to for each in other.phases]
    if one.feasible != other.feasible or one.parts != other.parts or phases[0] != phases[1]:
        return Difference(inf, 0.0)
    pairs = list(zip(one.phases, other.phases, strict=True))
    return Difference(
        max((abs(a.natural - b.natural) for a, b in pairs), default=0.0),
        max((b.shortest - a.shortest for a, b in pairs), default=0.0),
    )


def between(
    before: Sequence[Estimate],
    after: Sequence[Estimate],
    weight: float = 0.5,
    earlier: Sequence[tuple[Sequence[Estimate], Sequence[Estimate]]] = (),
) -> tuple[Estimate, ...]:
    """Estimates on the way from `before` to `after`, which is at weight 1. earlier: the same of the rounds before.

    Where each answer of the body makes the plan that calls for the other, the right one lies between: if one answer
    was more than was planned with, and the next is less, where a line through both says that it is neither. A phase
    of which all `earlier` answers say the same is taken as it is. What could not be hurried or slowed in one plan
    cannot in the next; a behavior that the body could not do then stays out.
    """
    known = {each.behavior: each for each in before}
    rounds = [(_naturals(made_with), _naturals(told)) for made_with, told in earlier]
    return tuple([_between(known.get(each.behavior, each), each, weight, rounds) for each in after])


def _naturals(estimates: Sequence[Estimate]) -> dict[tuple[str, str], Seconds]:
    return {(each.behavior, phase.to): phase.natural for each in estimates for phase in each.phases}


def _between(
    one: Estimate,
    other: Estimate,
    weight: float,
    rounds: Sequence[tuple[Mapping[tuple[str, str], Seconds], Mapping[tuple[str, str], Seconds]]],
) -> Estimate:
    if not one.feasible:
        return one
    if [each.to for each in one.phases] != [each.to for each in other.phases]:
        return other
    phases = []
    for a, b in zip(one.phases, other.phases, strict=True):
        key = (one.behavior, b.to)
        is_sure = bool(rounds) and all(abs(told.get(key, inf) - b.natural) <= NOTICEABLE for _, told in rounds)
        natural = (1.0 - weight) * a.natural + weight * b.natural
        if is_sure:
            natural = b.natural
        elif weight < 1.0 and rounds and key in rounds[-1][0] and key in rounds[-1][1]:
            planned, said = rounds[-1][0][key], rounds[-1][1][key]
            was_off, is_off = said - planned, b.natural - a.natural
            if was_off * is_off < 0.0:
                natural = a.natural + is_off * (a.natural - planned) / (was_off - is_off)
        longest = a.longest if b.longest is None else b.longest
        longest = None if longest is None else max(longest, natural)
        phases.append(replace(b, natural=natural, shortest=max(map(_haste, (a, b))) * natural, longest=longest))
    return replace(other, phases=tuple(phases))


def _haste(phase: Phase) -> float:
    """Share of its natural time that a phase takes at least."""
    return min(1.0, phase.shortest / phase.natural) if phase.natural else 0.0
