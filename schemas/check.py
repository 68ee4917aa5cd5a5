"""What is wrong with a block or fragment by itself, without knowing the world: the checks that XML and JSON share.

Ids, numbers, and references. Whether targets exist, what the body can do and whether the constraints can be
met is for generation and the realizer to say.
"""

import math
from collections.abc import Iterator, Mapping, Set
from difflib import get_close_matches
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Behavior, Event, Head, Reference, Speech, Wait
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import AnyInput, Input, disambiguated, marks, sites
from engage_hri.schemas.syncref import BLOCK_ITSELF, LONGEST_ID, SYNC_POINTS, SyncRef, is_id, is_sync_point

MOST_NODS = 1000
_SYNC_ADVICE = "write behavior:sync, behavior:sync+seconds, or seconds from the block's start"


class Problem(Struct, frozen=True):
    """path: JSON path. name: of the behavior or constraint. line: of the XML, 0 when there is none."""

    reason: str
    path: str
    name: str = ""
    line: int = 0
    advice: str = ""


def sound(thing: AnyInput, source: str = "", *, prefix: str = "$", paths: bool = False, line: int = 0) -> AnyInput:
    """The same, with marks that look like offsets made explicit: the gate for whatever did not come as XML.

    Raises InputRefused as `check` does.
    """
    thing = disambiguated(thing)
    check(thing, source, prefix=prefix, paths=paths, line=line)
    return thing


def check(thing: Input, source: str = "", *, prefix: str = "$", paths: bool = False, line: int = 0) -> None:
    """Raises InputRefused for the first problem: where, on which line, why, and what to do.

    source: file or sender. paths: say where by JSON path, which starts with `prefix`, even if lines are known.
    line: of the root element, for what is wrong with the whole.
    """
    for problem in problems(thing):
        problem = problem if problem.line else replace(problem, line=line)
        raise InputRefused(_fault(thing, problem, source, prefix, paths), thing.id or None)


def check_behavior(behavior: Behavior) -> None:
    """One behavior by itself, without what it refers to. Raises InputRefused for its first problem."""
    for problem in _behavior(behavior, "$.behavior"):
        raise InputRefused(Fault(reason=problem.reason, where=problem.path, line=problem.line, advice=problem.advice))


def _fault(thing: Input, problem: Problem, source: str, prefix: str, paths: bool) -> Fault:
    by_path = paths or not problem.line
    place = problem.path.replace("$", prefix, 1) if by_path else ": ".join(filter(None, (thing.id, problem.name)))
    return Fault(
        reason=problem.reason,
        where=": ".join(filter(None, (source, place))),
        line=0 if by_path else problem.line,
        advice=problem.advice,
    )


def problems(thing: Input) -> Iterator[Problem]:
    """Everything that is wrong: ids first, then each behavior, then references."""
    yield from _ids(thing)
    for index, behavior in enumerate(thing.behaviors):
        yield from _behavior(behavior, f"$.behaviors[{index}]")
    yield from _references(thing)


def _ids(thing: Input) -> Iterator[Problem]:
    if fault := _bad_id(thing.id):
        yield Problem(fault, "$.id", advice="a block's or fragment's id is part of every reference")
    seen: dict[str, int] = {}
    for index, behavior in enumerate(thing.behaviors):
        path = f"$.behaviors[{index}].id"
        yield from _id(behavior.id, path, behavior.line, seen, required=True)
    for index, constraint in enumerate(thing.constraints):
        yield from _id(constraint.id, f"$.constraints[{index}].id", constraint.line, seen, required=False)


def _id(id: str, path: str, line: int, seen: dict[str, int], *, required: bool) -> Iterator[Problem]:
    if not id and not required:
        return
    if fault := _bad_id(id):
        yield Problem(fault, path, id, line, "letters, digits and . _ - are safe")
    if id in seen:
        before = f", first on line {seen[id]}" if seen[id] else ""
        yield Problem(f"duplicate id {id!r}{before}", path, id, line, "give each its own id")
    seen.setdefault(id, line)


def _bad_id(id: str) -> str:
    if not id:
        return "no id"
    if id == BLOCK_ITSELF:
        return f"the id {BLOCK_ITSELF!r} is reserved for the block itself"
    if len(id) > LONGEST_ID:
        return f"id {id[:40]!r}... is longer than {LONGEST_ID} characters"
    if is_id(id):
        return ""
    return f"id {id!r} may hold neither spaces nor control characters nor ':' nor '+', nor begin with '-'"


def _behavior(behavior: Behavior, path: str) -> Iterator[Problem]:
    for reason, field, advice in _values(behavior):
        yield Problem(reason, f"{path}.{field}" if field else path, behavior.id, behavior.line, advice)
    if isinstance(behavior, Reference):
        yield from _options(behavior, path)


def _values(behavior: Behavior) -> Iterator[tuple[str, str, str]]:
    """Reason, field and advice."""
    for field in behavior.__struct_fields__:
        value = getattr(behavior, field)
        if isinstance(value, float) and not math.isfinite(value):
            yield f"{field} is {value}", field, "give a finite number"
    syncs = [timing.sync for timing in behavior.timing]
    for sync in syncs:
        if not is_sync_point(sync):
            yield f"{sync!r} is not a sync point", "timing", _SYNC_ADVICE
    if len(set(syncs)) < len(syncs):
        yield "a sync point is timed twice", "timing", "use a <constraint> for the second"
    if isinstance(behavior, Wait) and behavior.duration is not None and behavior.duration < 0:
        yield f"duration {behavior.duration} is negative", "duration", "seconds, 0 or more"
    if isinstance(behavior, Event) and behavior.limit is not None and behavior.limit <= 0:
        yield f"limit {behavior.limit} is not positive", "limit", "seconds"
    if isinstance(behavior, Head) and not 1 <= behavior.repetition <= MOST_NODS:
        yield f"repetition {behavior.repetition}", "repetition", f"1 to {MOST_NODS}"
    if isinstance(behavior, Speech):
        yield from _marks(behavior)


def _marks(speech: Speech) -> Iterator[tuple[str, str, str]]:
    ids = [mark.id for mark in speech.marks]
    for id in ids:
        if not is_sync_point(id) or id in ("start", "end"):
            yield f"{id!r} can't name a mark", "marks", "neither a number nor start nor end: the speech has those"
    if len(set(ids)) < len(ids):
        yield "two marks have the same name", "marks", "give each mark of a speech its own name"
    positions = [0, *(mark.position for mark in speech.marks), len(speech.text)]
    if any(earlier > later for earlier, later in pairwise(positions)):
        yield "marks out of order, or outside the text", "marks", "positions count characters of the text, ascending"


def _options(reference: Reference, path: str) -> Iterator[Problem]:
    if reference.minimum_reliability is not None and not 0 < reference.minimum_reliability < 1:
        reason = f"minimum reliability {reference.minimum_reliability:g} is outside (0, 1)"
        yield Problem(reason, f"{path}.minimum_reliability", reference.id, reference.line, "for example 0.85")
    if reference.options is None:
        return
    if not reference.options:
        advice = 'offer a phrase (speechOption); to have some proposed: propose="true", in JSON leave out `options`'
        yield Problem("no phrase to choose from", f"{path}.options", reference.id, reference.line, advice)
    for number, option in enumerate(reference.options):
        if not (math.isfinite(option.cost) and option.cost >= 0):
            line = option.line or reference.line
            reason = f"cost {option.cost:g} of phrase {option.text!r} is not a number of 0 or more"
            yield Problem(reason, f"{path}.options[{number}].cost", reference.id, line, "count its words")


def _references(thing: Input) -> Iterator[Problem]:
    points = _points(thing)
    if isinstance(thing, TurnFragment):
        yield from _inline(thing, points)
    for site in sites(thing):
        try:
            reference = SyncRef.parse(site.text)
        except ValueError as error:
            yield Problem(str(error), site.path, site.name, site.line, _SYNC_ADVICE)
            continue
        if not reference.behavior or reference.block not in ("", thing.id) or reference.behavior == BLOCK_ITSELF:
            continue
        if reference.behavior not in points:
            reason = f"unknown behavior {reference.behavior!r} in {site.text!r}"
            yield Problem(reason, site.path, site.name, site.line, _nearest(reference.behavior, points.keys()))
        elif isinstance(thing, TurnFragment) and canonical_sync(reference.sync) not in points[reference.behavior]:
            known = points[reference.behavior]
            reason = f"{reference.behavior!r} has no sync point {reference.sync!r}"
            yield Problem(reason, site.path, site.name, site.line, _nearest(reference.sync, known))


def _inline(fragment: TurnFragment, points: Mapping[str, Set[str]]) -> Iterator[Problem]:
    """Of a block the realizer drops a behavior that is timed at a point it lacks; a fragment is refused whole."""
    for index, behavior in enumerate(fragment.behaviors):
        for number, timing in enumerate(behavior.timing):
            known = points[behavior.id]
            if canonical_sync(timing.sync) not in known:
                path = f"$.behaviors[{index}].timing[{number}].sync"
                reason = f"{behavior.id!r} has no sync point {timing.sync!r}"
                yield Problem(reason, path, behavior.id, behavior.line, _nearest(timing.sync, known))


def _points(thing: Input) -> dict[str, Set[str]]:
    """The sync points of each behavior, in the drafts' spelling."""
    known: dict[str, Set[str]] = {}
    spoken = marks(thing)
    for behavior in thing.behaviors:
        if isinstance(behavior, Speech):
            known[behavior.id] = spoken[behavior.id] | {"start", "end"}
        elif isinstance(behavior, Reference):
            known[behavior.id] = {"start", "end"}
        else:
            known[behavior.id] = frozenset(SYNC_POINTS)
    return known


def _nearest(name: str, known: Set[str]) -> str:
    near = get_close_matches(name, sorted(known), n=1)
    return f"did you mean {near[0]!r}?" if near else f"known: {', '.join(sorted(known)[:12]) or 'none'}"
