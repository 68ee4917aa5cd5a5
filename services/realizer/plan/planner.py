"""Planning: from a block and what the body expects of its behaviors to the net and its earliest schedule.

Refused here, before anything moves: references to nothing, contradictions, and circles of waiting. Dropped here,
each with a warning: behaviors that the body cannot do, and those that cannot be on time. Document order decides only
between equals; any other permutation of a block gives the same net.

A block that is being performed is planned again when something was dropped, others came, or motions take longer.
"""

from collections.abc import Collection, Container, Iterable

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Hand
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.services.realizer.plan.assembly import Assembler, Assembly
from engage_hri.services.realizer.plan.handover import (
    Arrangement,
    Hands,
    Turn,
    arrange,
    kept_points,
    with_hands,
)
from engage_hri.services.realizer.plan.known import (
    NOTHING,
    Known,
    awaited,
    foreseen,
    is_foreign,
    naming_others,
    needless_turns,
    share,
    without_date,
)
from engage_hri.services.realizer.plan.losses import clashes
from engage_hri.services.realizer.plan.part_order import Untouched
from engage_hri.services.realizer.plan.phases import ARMS, as_run, natural_ends
from engage_hri.services.realizer.plan.plan import AT_EASE, Manner, Plan, compared, eased, standing
from engage_hri.services.realizer.plan.relations import BlockRefused, Equal, Term
from engage_hri.services.realizer.plan.remaining import Draft, remaining
from engage_hri.services.realizer.plan.repairs import Stuck, repaired
from engage_hri.services.realizer.plan.schedule import Impossible, Solution, critical_path, predict
from engage_hri.services.realizer.points import frozen
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
    draft = Draft(block, {each.behavior: each for each in estimates}, dropped, known, turns, manner)
    while (plan := (yield from _planned(draft, barred))) is None:
        yield SLICE
    return plan


plan_block = in_one_go(plan_tries)
"""Plan as `plan_tries` does, without a pause."""


def _planned(draft: Draft, barred: Container[tuple[str, Hand]]) -> Steps[Plan | None]:
    """The plan of the behaviors that are left; None if something had to be given up: it is to be planned anew.

    A conflict adds a turn, or settles a hand. Between two conflicts handovers only become more, or keep more. If
    an arrangement comes again all the same, so would all that followed it. None of these has a conflict: the last
    one is taken.
    """
    known = draft.known
    present, assembler = draft.begin_anew()
    natural = natural_ends(draft.chains, present)
    draft.turns = frozen(turn for turn in draft.turns if {turn[0], turn[1].behavior} <= draft.chains.keys())
    first = Arrangement(natural, known.begun, early=frozenset(draft.early), stops=known.stops)
    arrangement = replace(first, turns=draft.turns, spoken=draft.order.current)
    given = {name: holder.chain for name, holder in known.holders.items()}
    tried: list[Arrangement] = []
    """Arrangements since the last conflict."""
    while True:
        if (named := naming_others(present, arrangement)) != assembler.relations:
            assembler = Assembler(draft.chains, named, assembler.classes, assembler.waited_for)
        scheduled = yield from _scheduled(draft, assembler, arrangement)
        if scheduled is None:
            return None
        assembler, assembly, solution = scheduled
        classes = assembler.classes
        seen = Untouched(assembly, solution.times, present)
        if draft.order.find(seen, draft.chains, classes) or draft.parts.see(seen, draft.chains):
            return None
        times = {point: solution.times[transition] for point, transition in assembly.at.items()}
        everywhere = known.in_truth(draft.chains.values(), times, solution.times[-1])
        rounds = assembly.rounds(solution.times)
        kept = present.held.union(*(holder.kept for holder in known.holders.values()))
        hands = Hands({**draft.chains, **given}, everywhere, kept, barred)
        arranged, conflicts = arrange(draft.chains, present, arrangement, everywhere, rounds, hands, known.begun)
        undated = without_date(assembly, known) if given else ()
        arranged, others = share(draft.chains, present, known, arranged, everywhere, hands, assembly, undated)
        settled = draft.overlaps | draft.turns
        conflicts = [each for each in (*conflicts, *others) if each.is_open(known.begun, settled)]
        turns = [turn for turn, hand in conflicts if turn and not hand and not is_foreign(turn[1].behavior)]
        losses = clashes(turns, draft.chains, draft.relations.required, classes, everywhere, draft.spelling)
        if losses and not draft.manner.may_be_late:
            draft.give_up(losses, present)
            return None
        for conflict in conflicts:
            draft.settle(conflict)
        tried.append(arrangement)
        if conflicts:
            arrangement, tried = replace(first, turns=draft.turns, spoken=arrangement.spoken), []
        elif arranged not in tried:
            arrangement = arranged
        elif needless := needless_turns(draft.turns - draft.pruned, arranged.takes, known, draft.chains):
            draft.pruned |= needless
            draft.turns, draft.parts.given = draft.turns - needless, draft.parts.given - needless
            arrangement, tried = replace(first, turns=draft.turns, spoken=arrangement.spoken), []
        else:
            break
        yield SLICE
    plan = Plan(
        block=with_hands(draft.block, draft.hands),
        behaviors=tuple([chain.behavior for chain in draft.chains.values()]),
        net=assembly.net,
        at=assembly.at,
        members=assembly.members,
        schedule=tuple(solution.times),
        chains=dict(draft.chains),
        estimates=draft.estimates,
        natural=natural,
        required=present.required,
        waited_for=assembler.waited_for,
        kept=kept_points(draft.chains, present, arrangement.handovers),
        entering=arranged.ranked,
        turns=draft.turns,
        manner=draft.manner,
        late=draft.late,
        holders={
            name: given[name].parts for name in sorted({turn[1].behavior for turn in draft.turns} & given.keys())
        },
        rounds={id: rounds[chain.points[0]] for id, chain in draft.chains.items()},
        relations=present,
        untied=frozen(draft.untied),
        constrained=present.constrained,
        successors=arrangement.successors,
        takes=arrangement.takes,
        critical=critical_path(solution),
        dropped=tuple(draft.dropped),
        given_up=draft.given_up,
        problems=tuple(
            [one for one in draft.problems if one.kind != "DEGRADED" or one.behavior not in draft.dropped]
        ),
    )
    said = remaining(draft.relations, draft.chains, draft.dropped, draft.block.id)[0] if draft.untied else present
    return compared(plan, said, known)


def _scheduled(
    draft: Draft, assembler: Assembler, arrangement: Arrangement
) -> Steps[tuple[Assembler, Assembly, Solution] | None]:
    """The net and its schedule; None if the block is to be planned anew. Raises BlockRefused: a deadlock.

    Points in a circle without delay become one instant.
    """
    while True:
        assembler.waive(draft.customs)
        assembly = assembler.assemble(arrangement)
        if not assembly.is_ordered and (circles := assembler.circles()):
            classes = assembler.classes.copy()
            for points in circles:
                classes.tie(Equal(tuple([Term(point, 0.0, str(point)) for point in points])), draft.block.id)
            assembler = Assembler(draft.chains, assembler.relations, classes, assembler.waited_for)
            continue
        assembly = replace(assembly, net=standing(assembly.net, assembly.at, draft.chains, draft.manner.stands))
        times = foreseen(assembly, draft.known, draft.doubted)
        behind = tuple(awaited(assembly, draft.known, draft.waived))
        try:
            solution = predict(assembly.net, assembly.waits, times, behind, draft.manner.may_be_late)
        except Impossible as impossible:
            stuck = Stuck(impossible.circles, assembly, arrangement, assembler)
            if repaired(draft, stuck) == "anew":
                return None
            yield SLICE
        else:
            if draft.manner.may_be_late:
                net, draft.late = eased(assembly.net, solution.times)
                assembly = replace(assembly, net=net)
            return assembler, assembly, solution


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
