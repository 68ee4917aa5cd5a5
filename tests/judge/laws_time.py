"""Laws about times: what was asked for holds, what was predicted comes true, the voice keeps the document's order."""

from collections.abc import Iterator, Mapping
from itertools import combinations, pairwise, permutations
from math import inf

from engage_hri.schemas.blocks import WarningFeedback
from tests.judge.case import Case, Finding, merged, within
from tests.judge.reading import SHIFTS, WITH_STROKE, Place, Reading, Relation, Term

EXACT = 0.0101
"""Seconds: how much an exact body may miss an instant, or a prediction."""
STANDING = 0.5
"""Seconds in which a body comes to stand once it is held, and gets under way again."""
PROMISED = 0.1001
"""Seconds by which an instant may be missed untold: what people notice (`SKEW` of the realizer)."""
NOTICEABLE = 0.12
"""The same with a body that has faults, which does not always say when it was where."""


def constraints(case: Case) -> Iterator[Finding]:
    """Every constraint between points that were reached holds, or a warning names somebody of its instant.

    What people may notice is told, whatever the body does. What they do not is not told; an exact body does better
    than that, but where a point of another block asks for a time before the block began nobody could.
    """
    if not case.is_told_true:
        return
    told, tolerance = (PROMISED, EXACT) if case.is_exact else (NOTICEABLE, NOTICEABLE)
    for id, block in case.blocks.items():
        if case.record.began(id) is None:
            continue
        instants = _instants(block)
        warned = {(id, each.behavior) for each in case.record.warnings(id) if _excuses(each, case)}
        for relation in block.relations:
            terms = [term for term in relation.terms if _counts(term.place, id, case)]
            for one, other in combinations(terms, 2):
                if relation.kind != "same" and one is not relation.terms[0]:
                    continue
                gap = _gap(relation, case.times[one.place] + one.offset, case.times[other.place] + other.offset)
                touched = _touched(instants, one.place, other.place)
                held = _held(case, touched, one.place, other.place)
                if gap <= tolerance + held:
                    continue
                group = {(each.block, each.behavior) for each in touched}
                if group & warned or _was_late_abroad(group, id, case):
                    continue
                where = f"{relation.text}: {_shown(one, case)} against {_shown(other, case)}, off by {gap:.3f} s"
                is_silent = gap > told + held
                if is_silent or not _was_past(one, other, id, case):
                    yield Finding(_law(one, other, id, case) if is_silent else "inexact", id, where)


def _counts(place: Place, block: str, case: Case) -> bool:
    """True if the point was reached, nothing of its behavior was lost, and it was there to be named.

    A block that was broken off tells nothing of what others do after that.
    """
    if place not in case.times or (place.block, place.behavior) in case.lost:
        return False
    if place.block == block:
        return True
    asked = case.record.asked
    over = case.times.get(Place(block, "", "end"), inf)
    if case.record.status(block) != "done" and case.times[place] > over:
        return False
    if place.block not in asked or asked[place.block] > asked[block]:
        return False
    ends = case.record.ends.get(place.block, [])
    # A point of a block that was broken off: whoever waits for the end of that block is set free.
    is_whole = case.record.status(place.block) == "done" or place.behavior != ""
    return is_whole and not (ends and ends[0].at <= asked[block])


def _held(case: Case, touched: set[Place], *places: Place) -> float:
    """Seconds that a relation may be off since something was held between its points, or near.

    Something of these blocks, or of blocks that they share parts or points with, and may have to wait for. A wait
    whose end is one of these instants (`touched`) does not count the time either, from its start on.
    """
    if any(_ends_by_itself(case, place) for place in places):
        return inf
    times = [case.times[place] for place in places]
    held = merged(span for block in case.concerned(place.block for place in places) for span in case.holds(block))
    waits = [each for each in touched if case.blocks[each.block].behaviors[each.behavior].type == "wait"]
    clocks = [case.times[start] for each in waits if (start := each._replace(sync="start")) in case.times]
    seconds = within(held, min([min(times) - STANDING, *clocks]), max(times))
    return seconds + STANDING if seconds else 0.0


def _ends_by_itself(case: Case, place: Place) -> bool:
    """True if the behavior was held on its way to a point before which it cannot wait: it goes on to the next one."""
    asked = case.blocks[place.block].behaviors.get(place.behavior)
    start = case.times.get(Place(place.block, place.behavior, "start"))
    if asked is None or start is None:
        return False
    is_before_a_wait = asked.type in WITH_STROKE and place.sync == "ready"
    if not (asked.type in SHIFTS or is_before_a_wait or place.sync in ("relax", "end")):
        return False
    return within(case.holds(place.block, place.behavior), start, case.times[place]) > 0.0


def _gap(relation: Relation, one: float, other: float) -> float:
    if relation.kind == "same":
        return abs(one - other)
    return one - other if relation.kind == "after" else other - one


def _law(one: Term, other: Term, block: str, case: Case) -> str:
    if one.place.block == other.place.block == block:
        return "broken"
    return "broken, point was past" if _was_past(one, other, block, case) else "broken across blocks"


def _was_past(one: Term, other: Term, block: str, case: Case) -> bool:
    """True if a point of another block puts ours before our block began: nothing could be done about it."""
    for abroad, own in ((one, other), (other, one)):
        if abroad.place.block != block:
            meant = case.times[abroad.place] + abroad.offset - own.offset
            return meant < case.times[Place(block, "", "start")] - EXACT
    return False


def _instants(block: Reading) -> dict[Place, set[Place]]:
    """Points that are tied to each other by equalities, give or take an offset."""
    groups: dict[Place, set[Place]] = {}
    for relation in block.relations:
        if relation.kind == "same":
            for one, other in pairwise(relation.terms):
                merged = groups.get(one.place, {one.place}) | groups.get(other.place, {other.place})
                groups.update(dict.fromkeys(merged, merged))
    return groups


def _touched(instants: Mapping[Place, set[Place]], *places: Place) -> set[Place]:
    found: set[Place] = set()
    for place in places:
        found |= {each for each in instants.get(place, {place}) if each.behavior}
    return found


def _was_late_abroad(group: set[tuple[str, str]], block: str, case: Case) -> bool:
    return any(
        (other, each.behavior) in group
        for other in {other for other, _ in group} - {block}
        for each in case.record.warnings(other)
        if _excuses(each, case)
    )


def _excuses(warning: WarningFeedback, case: Case) -> bool:
    """True if a warning says that a time is not kept: something is late, or a speech gives it up for its words."""
    is_lost = (warning.block, warning.behavior) in case.lost
    return warning.kind == "LATE" or (warning.kind == "IMPOSSIBLE_TO_SCHEDULE" and not is_lost)


def _shown(term: Term, case: Case) -> str:
    place = term.place
    offset = f"{term.offset:+g}" if term.offset else ""
    return f"{place.behavior or place.block}:{place.sync}{offset} at {case.times[place] + term.offset:.3f}"


# -- predictions -----------------------------------------------------------------------------------------------------


def surprises(case: Case, block: str) -> list[tuple[float, str]]:
    """How far each point was off the last prediction told before it, with its name; the farthest first.

    What comes as another block comes, or has its turn, nobody can foresee: it is planned then, and may change it.
    """
    predictions = case.record.predictions(block)
    if not predictions:
        return []
    found = []
    comings = [deed.at for deed in case.story.deeds if deed.kind == "perform" and deed.block != block]
    turns = [each for each, other in case.blocks.items() if each != block and other.composition != "MERGE"]
    comings += [began for each in turns if (began := case.record.began(each)) is not None]
    for each in case.record.points(block):
        at = each.at.seconds
        if any(-EXACT < at - coming < EXACT for coming in comings):
            continue
        told = [message for when, message in predictions if when < at - EXACT]
        # Points of the block's first instant are told with the first predictions.
        told = told or [message for when, message in predictions if when <= at] or [predictions[0][1]]
        planned = {
            (point.behavior, point.sync): (message.at.seconds if message.at else 0.0) + point.time
            for message in told
            for point in message.points
        }
        if (expected := planned.get((each.behavior, each.sync))) is not None:
            found.append((abs(at - expected), f"{each.behavior}:{each.sync} at {at:.3f}, expected at {expected:.3f}"))
    return sorted(found, reverse=True)


def foreseeable(case: Case) -> list[str]:
    """Blocks whose points an exact body could have foreseen: nothing was disturbed, or lost on the way."""
    if not case.is_exact or case.story.is_disturbed:
        return []
    return [
        block for block in case.blocks if case.record.status(block) == "done" and not _lost_on_the_way(case, block)
    ]


def _lost_on_the_way(case: Case, block: str) -> bool:
    began = case.times[Place(block, "", "start")]
    named = {(term.place.block, term.place.behavior) for each in case.blocks[block].relations for term in each.terms}
    concerned = {block, *(other for other, _ in named if other in case.blocks)}
    return any(
        each.kind != "LATE"
        and (other, each.behavior) in case.lost
        and (other == block or (other, each.behavior) in named)
        and (each.at is None or each.at.seconds > began)
        for other in concerned
        for each in case.record.warnings(other)
    )


def misses(case: Case) -> list[float]:
    """Of each block that could be foreseen, how far its worst point was off the last prediction before it."""
    return [off[0][0] for block in foreseeable(case) if (off := surprises(case, block))]


def predictions(case: Case) -> Iterator[Finding]:
    """With an exact body, points come when the last prediction before them said, unless something was disturbed."""
    for block in foreseeable(case):
        off = surprises(case, block)
        if off and off[0][0] > EXACT:
            yield Finding("off its prediction", block, off[0][1])


# -- the order of words ----------------------------------------------------------------------------------------------


def spoken_order(case: Case) -> Iterator[Finding]:
    """Sentences come in the document's order, if that is possible, else in another; what can be served is not lost.

    Asked of blocks whose behaviors use parts of their own, but for words and nods, with the natural seconds that the
    body has named before.
    """
    if not case.record.natural or not case.is_exact:
        return
    for id, block in case.blocks.items():
        orders = [order for order in permutations(block.speeches) if _is_possible(case, block, order)]
        if not orders:
            continue
        outcome = case.record.outcome(id)
        if outcome is None or outcome.dropped:
            lost = "the block is refused" if outcome is None else f"{outcome.dropped} dropped"
            yield Finding("needless loss", id, f"{lost}, and {' '.join(orders[0])} can be said")
            continue
        starts = {speech: case.times.get(Place(id, speech, "start")) for speech in block.speeches}
        said = tuple(sorted(block.speeches, key=lambda speech: starts[speech] or 0.0))
        if block.speeches in orders and said != block.speeches:
            yield Finding("spoken order", id, f"said {' '.join(said)} instead of {' '.join(block.speeches)}")
        elif said not in orders:
            yield Finding("spoken order", id, f"said {' '.join(said)}, which cannot be")


def _is_possible(case: Case, block: Reading, order: tuple[str, ...]) -> bool:
    """Whether the speeches can be said in this order, every phase taking its natural time, with nods in any order."""
    nods = [each.id for each in block.behaviors.values() if each.type == "head"]
    return any(_is_possible_with(case, block, order, each) for each in permutations(nods))


def _is_possible_with(case: Case, block: Reading, order: tuple[str, ...], nods: tuple[str, ...]) -> bool:
    """The same for one order of the nods: each begins once the one before has made its stroke, and all that is asked
    of it. Single points, relaxed."""
    zero = Place(block.id, "", "start")
    lags: list[tuple[Place, Place, float]] = []
    places: set[Place] = {zero}
    for behavior in block.behaviors.values():
        phases = case.record.natural.get((block.id, behavior.id), ())
        draft = {since: Place(block.id, behavior.id, since) for since, *_ in phases}
        draft |= {to: Place(block.id, behavior.id, to) for _, to, *_ in phases}
        places.update(draft.values())
        for since, to, seconds, may_wait in phases:
            lags.append((draft[since], draft[to], seconds))
            is_on_target = behavior.type in ("gaze", "faceLexeme") and to == "stroke_end"
            if not may_wait and not is_on_target:
                lags.append((draft[to], draft[since], -seconds))
        lags += [(zero, place, 0.0) for place in draft.values()]
    for earlier, later in pairwise(order):
        lags.append((Place(block.id, earlier, "end"), Place(block.id, later, "start"), 0.0))
    asked = {_drafted(term.place, block) for relation in block.relations for term in relation.terms}
    for earlier, later in pairwise(nods):
        for point in [
            each for each in places if each.behavior == earlier and (each in asked or each.sync == "stroke_end")
        ]:
            lags.append((point, Place(block.id, later, "start"), 0.0))
    for relation in block.relations:
        first = relation.terms[0]
        for term in relation.terms[1:]:
            gap = first.offset - term.offset
            one, other = _drafted(first.place, block), _drafted(term.place, block)
            places |= {one, other}
            if relation.kind != "before":
                lags.append((one, other, gap))
            if relation.kind != "after":
                lags.append((other, one, -gap))
    return _settles(places, lags, zero)


def _settles(places: set[Place], lags: list[tuple[Place, Place, float]], zero: Place) -> bool:
    times = dict.fromkeys(places, 0.0)
    for _ in range(len(places) + 1):
        moved = False
        for since, to, seconds in lags:
            if times[since] + seconds > times[to] + 1e-9:
                times[to], moved = times[since] + seconds, True
        if not moved:
            return times[zero] <= 1e-6
    return False


_DRAFT = {"strokeStart": "stroke_start", "strokeEnd": "stroke_end", "attackPeak": "stroke"}


def _drafted(place: Place, block: Reading) -> Place:
    """The point as estimates name it: in the draft's spelling."""
    asked = block.behaviors.get(place.behavior)
    if asked is None or asked.type == "speech":
        return place
    if place.sync == "ready" and asked.type in ("gaze", "posture"):
        return place._replace(sync="stroke")
    return place._replace(sync=_DRAFT.get(place.sync, place.sync))
