"""Checks of a block or fragment by itself, for XML and JSON alike: ids, numbers, references.

Targets, the body and contradictions between constraints are checked by generation and the realizer, which know the
world.
"""

import math
from collections.abc import Iterator, Mapping, Set
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.behavior_types import SYNC_POINTS, canonical_sync
from engage_hri.schemas.behaviors import LONGEST_SPEECH, Behavior, Event, Head, Reference, Speech, Wait
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import LONGEST_WITHIN, TurnFragment
from engage_hri.schemas.references import (
    BLOCK_ITSELF,
    LONGEST_ID,
    AnyInput,
    Input,
    SyncRef,
    disambiguated,
    is_id,
    marks,
    objection,
    sites,
)

MOST_NODS = 1000
_SYNC_ADVICE = "write behavior:sync, behavior:sync+seconds, or seconds from the block's start"


class Problem(Struct, frozen=True):
    """An error in a document. path: JSON path. name: id of the behavior or constraint. line: of the XML, or 0."""

    reason: str
    path: str
    name: str = ""
    line: int = 0
    advice: str = ""


def validated(thing: AnyInput, source: str = "", *, prefix: str = "$", paths: bool = False) -> AnyInput:
    """Check a block or fragment that did not come as XML. The same is returned, after `disambiguated`.

    Raises InputRefused as `check` does.
    """
    thing = disambiguated(thing)
    check(thing, source, prefix=prefix, paths=paths)
    return thing


def check(thing: Input, source: str = "", *, prefix: str = "$", paths: bool = False, line: int = 0) -> None:
    """Refuse a block or fragment for its first problem. Raises InputRefused with place, line, reason and advice.

    source: file or sender. paths: tell the place as a JSON path, which begins with `prefix`, even if lines are known.
    line: of the root element, for problems of the whole document.
    """
    if problem := next(problems(thing), None):
        problem = problem if problem.line else replace(problem, line=line)
        raise InputRefused(_fault(thing, problem, source, prefix, paths), thing.id or None)


def check_behavior(behavior: Behavior) -> None:
    """Check one behavior by itself, without its references. Raises InputRefused for its first problem."""
    if problem := next(_behavior(behavior, "$.behavior"), None):
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
    """Find all problems: of ids first, then of each behavior, then of references."""
    yield from _ids(thing)
    if isinstance(thing, TurnFragment) and thing.within is not None and not 0 < thing.within <= LONGEST_WITHIN:
        advice = f"seconds, more than 0 and at most {LONGEST_WITHIN:g}"
        yield Problem(f"within is {thing.within:g}", "$.within", "", thing.line, advice)
    if isinstance(thing, TurnFragment) and (after := thing.interruptible_after) is not None and not after >= 0:
        reason = f"interruptible_after is {after:g}"
        yield Problem(reason, "$.interruptible_after", "", thing.line, "seconds, not less than 0")
    for index, behavior in enumerate(thing.behaviors):
        yield from _behavior(behavior, f"$.behaviors[{index}]")
    yield from _needs(thing)
    yield from _references(thing)


def _needs(thing: Input) -> Iterator[Problem]:
    known = {behavior.id: None for behavior in thing.behaviors}
    for index, behavior in enumerate(thing.behaviors):
        for number, needed in enumerate(behavior.needs):
            if needed not in known:
                reason, path = f"unknown behavior {needed!r} in needs", f"$.behaviors[{index}].needs[{number}]"
                yield Problem(reason, path, behavior.id, behavior.line, suggestion(needed, known))


def _ids(thing: Input) -> Iterator[Problem]:
    if fault := _bad_id(thing.id):
        yield Problem(fault, "$.id", advice="a block's or fragment's id is part of every reference")
    seen: dict[str, int] = {}
    for index, behavior in enumerate(thing.behaviors):
        yield from _id(behavior.id, f"$.behaviors[{index}].id", behavior.line, seen, required=True)
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
    """Problems with the values of a behavior's fields: reason, field, advice."""
    for field in behavior.__struct_fields__:
        value = getattr(behavior, field)
        if isinstance(value, float) and not math.isfinite(value):
            yield f"{field} is {value}", field, "give a finite number"
    syncs = [timing.sync for timing in behavior.timing]
    for sync in syncs:
        if not is_id(sync):
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
        if len(behavior.text) > LONGEST_SPEECH:
            reason = f"{len(behavior.text)} characters of speech, at most {LONGEST_SPEECH} are said in one go"
            yield reason, "text", "say it in several pieces"
        yield from _marks(behavior)


def _marks(speech: Speech) -> Iterator[tuple[str, str, str]]:
    ids = [mark.id for mark in speech.marks]
    for id in ids:
        if why := objection(id):
            yield f"{id!r} can't name a mark: {why}", "marks", "letters, digits, hyphens and the like, as in word-2"
        elif id in ("start", "end"):
            yield (
                f"{id!r} can't name a mark",
                "marks",
                "the speech has a start and an end of its own: give another name",
            )
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
            yield Problem(reason, site.path, site.name, site.line, suggestion(reference.behavior, points.keys()))
        elif isinstance(thing, TurnFragment) and canonical_sync(reference.sync) not in points[reference.behavior]:
            known = points[reference.behavior]
            reason = f"{reference.behavior!r} has no sync point {reference.sync!r}"
            yield Problem(reason, site.path, site.name, site.line, suggestion(reference.sync, known))


def _inline(fragment: TurnFragment, points: Mapping[str, Set[str]]) -> Iterator[Problem]:
    """Problems with inline timing at a point that the behavior lacks: `<gaze id="g" middle="...">`.

    Only of fragments, which are refused as a whole; in a block the realizer drops just such a behavior.
    """
    for index, behavior in enumerate(fragment.behaviors):
        for number, timing in enumerate(behavior.timing):
            known = points[behavior.id]
            if canonical_sync(timing.sync) not in known:
                path = f"$.behaviors[{index}].timing[{number}].sync"
                reason = f"{behavior.id!r} has no sync point {timing.sync!r}"
                yield Problem(reason, path, behavior.id, behavior.line, suggestion(timing.sync, known))


def _points(thing: Input) -> dict[str, Set[str]]:
    """Sync points of each behavior, in the drafts' spelling, by the behavior's id."""
    spoken = marks(thing)
    return {
        behavior.id: {"start", "end"} | spoken.get(behavior.id, frozenset())
        if isinstance(behavior, Speech | Reference)
        else frozenset(SYNC_POINTS)
        for behavior in thing.behaviors
    }
