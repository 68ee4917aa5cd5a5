"""Repairs of a plan: what is given up when ties of a net ask for more time than there is.

*What goes wrong.* A block says when its points come; the body says how long its phases take; behaviors wait for parts
of the body, for custom, and for other blocks. Each of these is a tie of the net. Where ties lead back to their start
and take more than no time, there is no schedule: `predict` returns these circles. Something in each must be given up.
The author should lose as little as possible of what was written, and hear of what is lost.

*How it is mended.* There is one list of rules, `REPAIRS`, from what costs nothing to what costs a behavior:

| rule | meets | gives up |
|---|---|---|
| `order_parts` | a wait for a part that leaves no time | who has the part first |
| `order_speeches` | a wait for the words before | the document's order of the speeches |
| `untie_from_holder` | a tie to the block whose part is waited for | that tie |
| `lose_to_others` | a wait for a part of another block | a time of the speech, or the behavior |
| `leave_sooner` | lasting until what waits for its end | lasting for that point |
| `waive_waits_of_others` | another block waits for what waits for it | minding that wait |
| `doubt_others` | news from another block that come too late | minding the news, or the tie to that point |
| `skip_customs` | a wait that nobody has asked for | the last such wait of each circle |
| `lose` | all else | a time of a speech, a behavior, or else the block |

The first rule that finds something to do ends the round. Then the net is scheduled `again` with the same arrangement
of parts, or everything is planned `anew` from the relations that are left.

*Why it ends.* There are finitely many ties, waits, points and behaviors, and what a rule gives up is gone for good.
Only the orders are different: that of the parts follows from who has been in the way, and these only become more;
that of the speeches is the document's, none, or the one found then, until one of their times is gone. A behavior
comes back only when a speech gives up a time.

*What it costs.* A round costs a net and a schedule: one to ten milliseconds for a
hundred behaviors. Therefore each rule settles all circles of a schedule at once.

A block that a person wrote needs no repair as a rule: of 43 files of strangers one did. Decisions 0143 and 0156.
"""

from collections.abc import Callable, Collection, Iterable
from typing import Literal, NamedTuple, TypeVar

from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.assembly import Assembler, Assembly
from engage_hri.services.realizer.plan.handover import Arrangement, Turn, by_ends, turns_in
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.losses import Loss, judge
from engage_hri.services.realizer.plan.remaining import Draft
from engage_hri.services.realizer.plan.schedule import Awaited, Circle, Foresight
from engage_hri.services.realizer.plan.words import other_part, taken
from engage_hri.services.realizer.points import Point

T = TypeVar("T")
Next = Literal["again", "anew"]
"""What follows a repair: another schedule of the same arrangement, or a new plan of what is left."""


class Stuck(NamedTuple):
    """A net without a schedule. circles: of its ties."""

    circles: tuple[Circle, ...]
    assembly: Assembly
    arrangement: Arrangement
    assembler: Assembler

    def turns_of(self, turns: Iterable[Turn], *circles: Circle) -> list[Turn]:
        """Find those of the turns that the circles go through."""
        return list(turns_in(by_ends(turns, self.assembly.at), *circles))

    def held_up(self) -> Iterable[tuple[Turn, set[Point], bool]]:
        """Waits for a part of another block, each with the points of its circle, and if the start is among them."""
        transitions = self.assembly.net.transitions
        for circle in self.circles:
            turn = next(iter(self.turns_of(self.arrangement.turns, circle)), None)
            if turn is not None and is_foreign(turn[1].behavior):
                ends = {end for tie, _ in circle for end in (tie.source, tie.target)}
                yield turn, {point for end in ends for point in transitions[end].points}, 0 in ends

    @property
    def ties(self) -> list[Place | Bound]:
        """All ties of the circles."""
        return [tie for circle in self.circles for tie, _ in circle]


def order_parts(draft: Draft, stuck: Stuck) -> Next | None:
    """Let behaviors have their parts in another order, as far as the ties leave room for one (`PartOrder`)."""
    waits = stuck.turns_of(draft.turns | stuck.arrangement.waits, *stuck.circles)
    return "anew" if draft.parts.change(waits, draft.turns, draft.chains, draft.known.begun) else None


def order_speeches(draft: Draft, stuck: Stuck) -> Next | None:
    """Say the speeches in another order than that of the document (`SpeakingOrder`)."""
    if not draft.order.refute(stuck.circles):
        return None
    draft.parts.begin_anew()
    return "anew"


def untie_from_holder(draft: Draft, stuck: Stuck) -> Next | None:
    """Untie points of a behavior from the block whose part it waits for: it would wait for itself.

    Where a time of the block is fixed besides, the tie is not to blame.
    """
    named = draft.relations.constrained
    tied = {point for _, points, is_timed in stuck.held_up() if not is_timed for point in points & named}
    return _noted(draft.untied, {point for point in tied if is_foreign(point.behavior)}, "anew")


def lose_to_others(draft: Draft, stuck: Stuck) -> Next | None:
    """Lose behaviors that have no time to wait until another block is done with their part, in document order.

    A speech gives up its times before it is lost: it may wait until the other has the voice no more.
    """
    found = dict[str, Loss]()
    for (id, until), among, _ in stuck.held_up():
        chain = draft.chains[id]
        holder = draft.known.holders.get(until.behavior)
        held = holder.chain.parts if holder is not None else chain.parts
        has = taken(
            until.behavior,
            [part for part in chain.parts if part in held],
            until,
            draft.spelling,
            at=draft.known.points.get(until),
        )
        points = tuple([point for point in chain.points if chain.type == "speech" and point in among])
        advice = other_part(id, chain.parts, held, draft.spelling)
        found[id] = Loss(id, f"cannot be on time: {has}", points, frozenset(among), (id, until), advice)
    if not found:
        return None
    draft.give_up([found[id] for id in draft.chains if id in found], stuck.assembler.relations)
    return "anew"


def leave_sooner(draft: Draft, stuck: Stuck) -> Next | None:
    """Let behaviors that last with the block not last for points that wait, through another block, for their end."""
    at, transitions = stuck.assembly.at, stuck.assembly.net.transitions
    targets = {at[Point(id, "relax")]: id for id in stuck.arrangement.lasting}
    early = {
        (id, point)
        for circle in stuck.circles
        if any(isinstance(tie, Awaited) for tie, _ in circle)
        for tie, _ in circle
        if isinstance(tie, Place) and tie.after and (id := targets.get(tie.target)) and tie.behavior == id
        for point in transitions[tie.source].points
        if point.behavior == tie.after
    }
    return _noted(draft.early, early, "anew")


def waive_waits_of_others(draft: Draft, stuck: Stuck) -> Next | None:
    """Let another block wait in vain for what waits for it, whatever is planned."""
    return _noted(draft.waived, {tie.pair for tie in stuck.ties if isinstance(tie, Awaited)}, "again")


def doubt_others(draft: Draft, stuck: Stuck) -> Next | None:
    """Forget when points of others are expected where that is too late for times that are fixed."""
    transitions = stuck.assembly.net.transitions
    late = {
        point for tie in stuck.ties if isinstance(tie, Foresight) for point in transitions[tie.target].points
    } - draft.doubted
    foreign = {point for point in late if is_foreign(point.behavior)}
    draft.untied |= foreign
    return _noted(draft.doubted, late, "anew" if foreign else "again")


def skip_customs(draft: Draft, stuck: Stuck) -> Next | None:
    """Leave out waits that are mere custom: of those of neighbors in a circle, only the last in the document."""
    rank = {id: number for number, id in enumerate(draft.places)}
    skipped = [tie for tie in stuck.ties if tie.kind != "series"]
    for circle in stuck.circles:
        customs = [tie for tie, _ in circle if tie.kind == "series" and not tie.behavior]
        ranks = [max(rank.get(each.behavior, -1) for each in stuck.assembly.members[it.target]) for it in customs]
        skipped += [customs[ranks.index(max(ranks))]] if customs else []
    return _noted(draft.customs, stuck.assembly.waits(skipped), "again")


def lose(draft: Draft, stuck: Stuck) -> Next:
    """Lose a behavior for each circle, or a time of a speech. Raises BlockRefused if neither can be."""
    turns = draft.turns | stuck.arrangement.waits | draft.order.turns
    net, ends, present = stuck.assembly.net, by_ends(turns, stuck.assembly.at), stuck.assembler.relations
    found = judge(
        stuck.circles, net, draft.chains, present, stuck.assembler.classes, draft.block.id, ends, draft.spelling
    )
    draft.give_up(found, present)
    return "anew"


def _noted(noted: set[T], found: Collection[T], then: Next) -> Next | None:
    """Note what was found; returns what follows, or None if there is nothing in it that is new."""
    is_new = not noted.issuperset(found)
    noted.update(found)
    return then if is_new else None


REPAIRS: tuple[Callable[[Draft, Stuck], Next | None], ...] = (
    order_parts,
    order_speeches,
    untie_from_holder,
    lose_to_others,
    leave_sooner,
    waive_waits_of_others,
    doubt_others,
    skip_customs,
    lose,
)
"""The rules in the order in which they are tried."""


def repaired(draft: Draft, stuck: Stuck) -> Next:
    """Mend a net without a schedule by the first rule that can; returns what follows. Raises BlockRefused."""
    return next(then for repair in REPAIRS if (then := repair(draft, stuck)) is not None)
