"""Laws about what holds where nobody has said anything: how long a wait takes, who lasts, who comes after whom."""

from collections.abc import Iterator
from itertools import pairwise

from msgspec.structs import replace

from tests.judge.case import Case, Done, Finding, within
from tests.judge.laws_time import EXACT
from tests.judge.reading import LASTING, SHIFTS, WITH_STROKE, Asked, Place, Reading, Relation, Term

LEAVING = ("stroke_end", "relax", "end")
"""Points that say when a look, a face or a posture ends."""
FAMILIES = (
    ("gaze",),  # a shift of the eyes lies beneath
    ("face", "faceLexeme", "faceFacs", "faceShift"),
    ("posture", "postureShift"),
)
IN_A_ROW = (*WITH_STROKE, *SHIFTS, "wait", "speech")


def customs(case: Case) -> Iterator[Finding]:
    """A wait takes its time, a look lasts, and of one type the next follows the one before."""
    if not case.is_told_true:
        return
    for id, block in case.blocks.items():
        if case.record.status(id) != "done":
            continue
        done = {
            each.asked.id: each for each in case.done if each.block == id and (id, each.asked.id) not in case.lost
        }
        for each in done.values():
            if each.asked.type == "wait" and not _is_named(block, each.asked, "end"):
                yield from _length(case, each)
            if each.asked.type in LASTING and (relaxed := each.time("relax")) is not None:
                left = _without_the_lost(case, block, relaxed)
                if not _is_named(left, each.asked, *LEAVING):
                    yield from _lasts(case, left, each, relaxed, done)
        yield from _rows(block, done)


def _without_the_lost(case: Case, block: Reading, by: float) -> Reading:
    """The block without what was lost by then, before it was there, as if that had never been written.

    What was one instant with a point that is lost stays tied to what else was, by docs/realizer.md; but what a lost
    behavior says of itself is lost with it.
    """
    relations = []
    tied: dict[Place, list[Term]] = {}
    for each in block.relations:
        gone = [term for term in each.terms if _is_gone(case, term, by)]
        if any(term.place[:2] == (block.id, each.own) for term in gone):
            continue
        left = tuple(term for term in each.terms if term not in gone)
        if len(left) > 1:
            relations.append(replace(each, terms=left))
        for term in gone if each.kind == "same" else ():
            # In the seconds of the lost point, whatever its offset was here.
            meant = [other._replace(offset=other.offset - term.offset) for other in left]
            tied.setdefault(term.place, []).extend(meant)
    relations += [
        Relation("same", tuple(terms), f"through {place.behavior}:{place.sync}")
        for place, terms in tied.items()
        if len(terms) > 1
    ]
    return replace(block, relations=tuple(relations))


def _is_gone(case: Case, term: Term, by: float) -> bool:
    """True if it was known by then that this point will not come: its behavior is lost, or its block has ended."""
    if term.place in case.times:
        return False
    block, behavior = term.place[:2]
    told = [each.at.seconds for each in case.record.warnings(block) if each.behavior == behavior and each.at]
    is_lost = (block, behavior) in case.lost and not (told and max(told) > by + EXACT)
    return is_lost or any(each.at <= by + EXACT for each in case.record.ends.get(block, []))


def _length(case: Case, done: Done) -> Iterator[Finding]:
    """A wait takes the seconds that it names; the time in which it is held does not count."""
    start, end = done.time("start"), done.time("end")
    asked = float(done.asked.attributes.get("duration", "0"))
    if start is None or end is None:
        return
    held = within(case.holds(done.block, done.asked.id), start, end)
    if abs(end - start - held - asked) > EXACT:
        text = f"{done.name} took {end - start:.3f} s" + (f", held for {held:.3f} s of it" if held else "")
        yield Finding("wrong length", done.block, text, done.asked.id)


def _lasts(case: Case, block: Reading, one: Done, left: float, done: dict[str, Done]) -> Iterator[Finding]:
    """A look whose end is left open ends with all else in the block, or where the next of its kind starts."""
    if (begun := one.time("start")) is None:
        return
    family = next(family for family in FAMILIES if one.asked.type in family)
    takers = [
        start
        for other in case.done
        if other is not one and other.asked.type in family and (start := other.time("start")) is not None
    ]
    others = [
        end
        for other in done.values()
        if other is not one and not _is_open(block, other.asked) and (end := other.time("end")) is not None
    ]
    until = min([max(others, default=begun), *(start for start in takers if start >= begun - EXACT)])
    if left < until - 2 * EXACT:
        text = f"{one.name} relaxes at {left:.3f}, and nothing asks for that before {until:.3f}"
        yield Finding("left too early", one.block, text, one.asked.id)


def _rows(block: Reading, done: dict[str, Done]) -> Iterator[Finding]:
    """A behavior of which nothing is said begins when the one before it, of its type, has ended."""
    for type in IN_A_ROW:
        row = [asked for asked in block.behaviors.values() if asked.type == type and asked.id in done]
        for before, after in pairwise(row):
            if _is_named(block, after, *after.points):
                continue
            end, start = done[before.id].time("end"), done[after.id].time("start")
            if end is not None and start is not None and start < end - EXACT:
                text = f"{done[after.id].name} begins at {start:.3f}, and {before.id} ends at {end:.3f}"
                yield Finding("out of turn", block.id, text, after.id)


def _is_open(block: Reading, asked: Asked) -> bool:
    return asked.type in LASTING and not _is_named(block, asked, *LEAVING)


def _is_named(block: Reading, asked: Asked, *syncs: str) -> bool:
    """True if a relation names one of these points of the behavior, in whatever spelling."""
    spelled = {sync.replace("strokeEnd", "stroke_end") for sync in syncs}
    return any(
        term.place.behavior == asked.id
        and term.place.block == block.id
        and term.place.sync.replace("strokeEnd", "stroke_end") in spelled
        for relation in block.relations
        for term in relation.terms
    )
