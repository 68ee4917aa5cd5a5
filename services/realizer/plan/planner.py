"""Planning: from a block and what the body expects of its behaviors to the net and its earliest schedule.

Refused here, before anything moves: references to nothing, contradictions, and circles of waiting. Dropped here,
each with a warning: behaviors that the body cannot do, and those that cannot be on time. Document order decides only
between equals; any other permutation of a block gives the same net.

A block that is being performed is planned again when something was dropped, others came, or motions take longer.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from functools import partial

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Hand, Unknown
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.plan import other_blocks
from engage_hri.services.realizer.plan.assembly import Assembler, Assembly
from engage_hri.services.realizer.plan.handover import (
    Arrangement,
    Conflict,
    Hands,
    Turn,
    arrange,
    by_ends,
    kept_points,
    turns_in,
    with_hands,
)
from engage_hri.services.realizer.plan.known import NOTHING, Known, is_foreign
from engage_hri.services.realizer.plan.losses import Loss, Losses, Times, clashes, judge
from engage_hri.services.realizer.plan.other_blocks import naming_others, needless_turns, share
from engage_hri.services.realizer.plan.part_order import PartOrder
from engage_hri.services.realizer.plan.phases import ARMS, Chain, as_run, chain, natural_ends, unawaited_events
from engage_hri.services.realizer.plan.plan import AT_EASE, Late, Manner, Plan, compared, eased, standing
from engage_hri.services.realizer.plan.relations import (
    BlockRefused,
    Classes,
    Equal,
    Problem,
    Relations,
    Term,
    as_dropped,
    at_line,
    relations_of,
)
from engage_hri.services.realizer.plan.remaining import falling, refused, remaining, unknown, untied, without
from engage_hri.services.realizer.plan.schedule import Impossible, Solution, critical_path, predict
from engage_hri.services.realizer.plan.speaking_order import Misordered, SpeakingOrder, may_speak_at_once
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.points import Point, frozen
from engage_hri.services.runtime.steps import SLICE, Steps, in_one_go


def plan_tries(
    block: Block,
    estimates: Iterable[Estimate] = (),
    *,
    dropped: Iterable[str] = (),
    known: Known = NOTHING,
    barred: Container[tuple[str, Hand]] = (),
    turns: frozenset[Turn] = frozenset(),
    manner: Manner = AT_EASE,
) -> Steps[Plan]:
    """Plan `block`; durations that no estimate gives are nominal. Raises BlockRefused, with place and line.

    There is a pause before each net but the first, however long that took. A block that a person wrote is settled
    with the first net. Others need as many as they have behaviors, and who performs something else meanwhile gets its
    turn at the pauses.

    dropped: behaviors to leave out as if never written. known: other live blocks. barred: hands with which a behavior
    cannot be done. turns: those to begin with. manner: see there.
    """
    planner = _Planner(block, {each.behavior: each for each in estimates}, dropped, barred, known, manner)
    planner.parts = PartOrder(turns)
    planner.read()
    return (yield from planner.plan())


plan_block = in_one_go(plan_tries)
"""Plan as `plan_tries` does, without a pause."""


class _Planner:
    def __init__(
        self,
        block: Block,
        estimates: Mapping[str, Estimate],
        dropped: Iterable[str],
        barred: Container[tuple[str, Hand]],
        known: Known,
        manner: Manner,
    ) -> None:
        self.block = block
        self.manner = manner
        self.late: Late = {}
        self.known = known
        self.doubted: set[Point] = set()  # known points, not planned for when they came or are expected
        self.untied: set[Point] = set(known.untied)  # see `Plan`
        self.early: frozenset[tuple[str, Point]] = frozenset()  # see `Arrangement`
        self.customs: set[tuple[str, str]] = set()  # waits by mere custom for which there is no time
        self.waived: set[tuple[Point, Point]] = set()  # own and other, that wait for each other whatever is planned
        self.spelling = Spelling(block, known.blocks)
        self.lines = {behavior.id: behavior.line for behavior in block.behaviors}
        self.estimates = estimates
        self.barred = barred
        self.dropped = dict.fromkeys([*dropped, *(each.behavior for each in manner.lost)])
        """Behaviors in the order in which they were dropped; the values mean nothing."""
        self.depending: dict[str, tuple[Chain, Loss, Problem]] = {}
        """Dropped behaviors that may be on time after all if a speech gives up a time, with why they were dropped."""
        self.given_up: dict[str, dict[str, Problem]] = {}  # see `Plan`
        self.turns = frozenset[Turn]()
        self.overlaps: set[Turn] = set()  # turns that there is no time to wait for
        self.pruned: set[Turn] = set()  # turns that were found to be needless, once
        self.parts = PartOrder()
        self.hands: dict[str, Hand] = {}
        self.chains: dict[str, Chain] = {}

    def read(self) -> None:
        self.relations = relations_of(self.block, self.known.blocks)
        self.problems = [*dict.fromkeys((*self.relations.problems, *self.manner.lost))]
        for behavior in self.block.behaviors:
            if behavior.id not in self.dropped:
                self._read(behavior)
        self._let_fall()
        if begun := sorted(
            self.known.begun & self.chains.keys(), key=lambda id: self.known.natural_end(self.chains[id])
        ):
            # Who has begun comes first; neighbors come after the last of these to end.
            self.chains = {id: self.chains[id] for id in dict.fromkeys((*begun, *self.chains))}
        self.places = tuple(self.chains)
        self.speeches = {id for id, chain in self.chains.items() if chain.type == "speech"}
        self.order = SpeakingOrder([id for id in self.chains if id in self.speeches], len(self.chains))

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

    def plan(self) -> Steps[Plan]:
        """The plan; behaviors that cannot be on time are dropped until the rest can be.

        It comes to an end: each time it is tried anew, a time of a speech is gone for good, a turn that nobody can
        wait for, or a tie to another block; or else a behavior is gone, or the speeches are in an order that is new.
        """
        while True:
            self.turns = self.parts.turns - self.overlaps
            said = self.relations
            left = untied(said, self.untied) if self.untied else said
            present, classes = remaining(left, self.chains, self.dropped, self.block.id)
            try:
                plan = yield from self._plan(present, classes)
                if self.untied:
                    present, _ = remaining(said, self.chains, self.dropped, self.block.id)
                return compared(plan, present, self.known)
            except Misordered:
                pass
            except Losses as found:
                waits = [loss.turn for loss in found.losses if loss.turn in self.turns]
                if not self.parts.change(waits, self.turns, self.chains, self.known.begun):
                    self._give_up(found.losses, present)
            yield SLICE

    def _give_up(self, found: Iterable[Loss], present: Relations) -> None:
        """Give up what cannot be on time: a wait, a time of a speech, or else the behavior."""
        times = Times(self.relations, self.speeches)
        gone, losses, given_up = {*self.dropped}, list[Loss](), set[Point]()
        for loss in found:
            turn = loss.turn
            if turn and turn in self.turns and may_speak_at_once(turn[1].behavior, self.chains, present):
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
        self.order.begin_anew(self.chains)
        self.parts.begin_anew()
        self.doubted.clear()  # What they were too late for may be gone.

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

    def _plan(self, present: Relations, classes: Classes) -> Steps[Plan]:
        """The plan of the behaviors that are left. Raises Losses: those that cannot be on time.

        A conflict adds a turn, or settles a hand. Between two conflicts handovers only become more, or keep more. If
        an arrangement comes again all the same, so would all that followed it. None of these has a conflict: the last
        one is taken.
        """
        natural = natural_ends(self.chains, present)
        waited_for = frozenset(self.chains) - unawaited_events(self.chains, present)
        self.turns = frozen(turn for turn in self.turns if {turn[0], turn[1].behavior} <= self.chains.keys())
        arranged_anew = partial(Arrangement, natural, self.known.begun, early=self.early, stops=self.known.stops)
        arrangement = arranged_anew(turns=self.turns, spoken=self.order.current)
        assembler = Assembler(self.chains, present, classes, waited_for)
        given = {name: holder.chain for name, holder in self.known.holders.items()}
        tried: list[Arrangement] = []
        """Arrangements since the last conflict."""
        while True:
            assembler.waive(self.customs)
            if (named := naming_others(present, arrangement)) != assembler.relations:
                assembler = Assembler(self.chains, named, classes, waited_for)
            assembler, assembly, solution = yield from self._solved(assembler, arrangement, classes)
            times = {point: solution.times[transition] for point, transition in assembly.at.items()}
            self.parts.see(assembly, solution.times, present)
            everywhere = self.known.in_truth(self.chains.values(), times, solution.times[-1])
            rounds = assembly.rounds(solution.times)
            kept = present.held.union(*(holder.kept for holder in self.known.holders.values()))
            hands = Hands({**self.chains, **given}, everywhere, kept, self.barred)
            arranged, conflicts = arrange(
                self.chains, present, arrangement, everywhere, rounds, hands, self.known.begun
            )
            undated = other_blocks.without_date(assembly, self.known) if given else ()
            arranged, others = share(self.chains, present, self.known, arranged, everywhere, hands, assembly, undated)
            conflicts = [
                each for each in (*conflicts, *others) if each.is_open(self.known.begun, self.overlaps | self.turns)
            ]
            own = (each.turn for each in conflicts if each.turn and not each.hand)
            turns = [turn for turn in own if not is_foreign(turn[1].behavior)]
            losses = clashes(turns, self.chains, self.relations.required, classes, everywhere, self.spelling)
            if losses and not self.manner.may_be_late:
                raise Losses(losses)
            for conflict in conflicts:
                self._resolve(conflict)
            tried.append(arrangement)
            if conflicts:
                arrangement, tried = arranged_anew(turns=self.turns, spoken=arrangement.spoken), []
            elif arranged not in tried:
                arrangement = arranged
            elif needless := needless_turns(self.turns - self.pruned, arranged.takes, self.known, self.chains):
                self.pruned |= needless
                self.turns, self.parts.given = self.turns - needless, self.parts.given - needless
                arrangement, tried = arranged_anew(turns=self.turns, spoken=arrangement.spoken), []
            else:
                break
            yield SLICE
        return Plan(
            block=with_hands(self.block, self.hands),
            behaviors=tuple([chain.behavior for chain in self.chains.values()]),
            net=assembly.net,
            at=assembly.at,
            members=assembly.members,
            schedule=tuple(solution.times),
            chains=dict(self.chains),
            estimates=self.estimates,
            natural=natural,
            required=present.required,
            waited_for=waited_for,
            kept=kept_points(self.chains, present, arrangement.handovers),
            entering=arranged.ranked,
            turns=self.turns,
            manner=self.manner,
            late=self.late,
            holders={
                name: given[name].parts for name in sorted({turn[1].behavior for turn in self.turns} & given.keys())
            },
            rounds={id: rounds[chain.points[0]] for id, chain in self.chains.items()},
            relations=present,
            untied=frozen(self.untied),
            constrained=present.constrained,
            successors=arrangement.successors,
            takes=arrangement.takes,
            critical=critical_path(solution),
            dropped=tuple(self.dropped),
            given_up=self.given_up,
            problems=tuple(
                one for one in self.problems if one.kind != "DEGRADED" or one.behavior not in self.dropped
            ),
        )

    def _solved(
        self, assembler: Assembler, arrangement: Arrangement, classes: Classes
    ) -> Steps[tuple[Assembler, Assembly, Solution]]:
        """The net and its schedule; points in a circle without delay become one instant.

        Raises Losses, or BlockRefused: a deadlock.
        """
        while True:
            assembly = assembler.assemble(arrangement)
            net = standing(assembly.net, assembly.at, self.chains, self.manner.stands)
            if assembly.is_ordered or not (circles := assembler.circles()):
                break
            for points in circles:
                terms = tuple([Term(point, 0.0, str(point)) for point in points])
                classes.tie(Equal(terms), self.block.id)
            assembler = Assembler(self.chains, assembler.relations, classes, assembler.waited_for)
        try:
            times = other_blocks.foreseen(assembly, self.known, self.doubted)
            behind = tuple(other_blocks.awaited(assembly, self.known, self.waived))
            is_custom, may_be_late = (lambda ties: bool(assembly.waits(ties))), self.manner.may_be_late
            solution = predict(net, is_custom, times, behind, may_be_late)
            if may_be_late:
                net, self.late = eased(net, solution.times)
            assembly = replace(assembly, net=net)
            if self.order.pass_alone(assembly.net, assembly.at, solution.times):
                raise Misordered
            return assembler, assembly, solution
        except Impossible as impossible:
            turns = self.turns | arrangement.waits
            waits = list(turns_in(by_ends(turns, assembly.at), *impossible.circles))
            if self.parts.change(waits, self.turns, self.chains, self.known.begun):
                raise Misordered from None
            if self.order.refute(impossible.circles, assembly.net):
                self.parts.begin_anew()
                raise Misordered from None
            if tied := other_blocks.ties_within_turns(
                impossible, assembly, arrangement.turns, self.relations.constrained
            ).difference(self.untied):
                self.untied |= tied
                raise Misordered from None
            if taken := other_blocks.losses_to_others(
                impossible, assembly, arrangement.turns, self.chains, self.known, self.spelling
            ):
                raise Losses(taken) from None
            if early := other_blocks.lasting_for_ever(impossible, assembly, arrangement.lasting):
                self.early |= early
                raise Misordered from None
            if futile := other_blocks.futile(impossible):
                self.waived |= futile
            elif late := other_blocks.too_late(impossible, assembly) - self.doubted:
                self.doubted |= late
                if foreign := {point for point in late if is_foreign(point.behavior)}:
                    self.untied |= foreign
                    raise Misordered from None
            elif idle := other_blocks.idle(impossible, assembly, self.places):
                self.customs |= idle
                assembler.waive(self.customs)
            else:
                present, turns = assembler.relations, turns | self.order.turns
                raise judge(
                    impossible, assembly, self.chains, present, classes, self.block.id, turns, self.spelling
                ) from None
            yield SLICE
            return (yield from self._solved(assembler, arrangement, classes))

    def _resolve(self, conflict: Conflict) -> None:
        """Settle a conflict: one of the two uses the other arm, or waits for its turn."""
        if conflict.hand is None:
            assert conflict.turn is not None
            self.turns |= {conflict.turn}
            return
        id, hand = conflict.hand
        self.hands[id] = hand
        self.chains[id] = chain(replace(self.chains[id].behavior, mode=hand), self.estimates.get(id))


def planned_again(so_far: Plan, known: Known, gone: Iterable[str]) -> Plan:
    """A plan of a block as if the behaviors that are gone had never been written. Raises BlockRefused."""
    known = _still_untied(so_far, known)
    plan = plan_block(
        so_far.block,
        so_far.estimates.values(),
        dropped=gone,
        known=known,
        barred=_chosen(so_far, known),
        manner=so_far.manner,
    )
    return replace(plan, net=as_run(plan.net))


def reestimated(so_far: Plan, known: Known, gone: Collection[str], estimates: Iterable[Estimate]) -> Plan | None:
    """The plan with other estimates; None if these would cost a behavior, or a part that somebody else has.

    A motion that takes another time is no reason for that: blocks that plan with each other would never agree.
    """
    known = _still_untied(so_far, known)
    try:
        plan = plan_block(
            so_far.block,
            estimates,
            dropped=gone,
            known=known,
            barred=_chosen(so_far, known),
            turns=so_far.turns,
            manner=so_far.manner,
        )
    except BlockRefused:
        return None
    costs = {*plan.dropped} - {*gone, *so_far.dropped} or plan.takes.items() - so_far.takes.items()
    return None if costs else replace(plan, net=as_run(plan.net))


def _chosen(so_far: Plan, known: Known) -> set[tuple[str, Hand]]:
    """Hands that are not to be chosen: blocks that came later were planned around the arms that this one uses."""
    return {(id, hand) for id in so_far.chains.keys() - known.due for hand in ARMS}


def _still_untied(so_far: Plan, known: Known) -> Known:
    """Knowledge with the ties that were given up: others were planned with that in mind."""
    return replace(known, untied=known.untied | so_far.untied) if so_far.untied else known
