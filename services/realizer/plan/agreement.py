"""Agreement of a plan with what the body says about it: each answer may make another plan, with another answer.

A plan is made with what the body promises of each phase: its natural time, and how short and how long it can be.
What a phase takes in truth depends on how the behavior comes to it, so on the plan. The body rehearses each plan, and
its answer is what the next plan is made with. Two things can happen.

- They agree: the answer is what the plan was made with. The body can keep this plan.
- They never agree: each answer makes the plan that calls for the other. Then what each plan comes to is computed from
  the answer to it (`as_told`), and with it what that plan would miss.

The search goes from later to faster, from there to told late, and from there to dropped. The net lets behaviors wait
and dawdle before any hurries (`predict`). If the best plan misses what the block says, the block is planned in the
next manner (`manner.py`): times may be missed by as little as can be, then behaviors also stand before they hurry. Of
all plans in all manners the one is taken that misses least, where the doubt that is left counts as missed. It is told
LATE before anything moves. A behavior is dropped only if the first promise left no time for it, or if there is no
such plan.
"""

from collections.abc import Iterator, Mapping, Sequence
from math import inf
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.body import Estimate, EstimateBehaviors, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.manner import AT_EASE, Manner
from engage_hri.services.realizer.plan.outcome import as_told
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.poses import NOTICEABLE
from engage_hri.services.realizer.plan.slack import UNNOTICED, slack
from engage_hri.services.realizer.points import Point, frozen

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
