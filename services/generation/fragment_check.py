"""Checks of a fragment before anything of it is performed: it is sound, and the world knows all that it names.

A bad fragment is refused as a whole, and the fault says where it is wrong.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    LONGEST_SPEECH,
    Gaze,
    GazeShift,
    HeadDirectionShift,
    Pointing,
    Reference,
    Speech,
)
from engage_hri.schemas.check import validated
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.suggestion import suggestion
from engage_hri.schemas.syncref import SyncRef
from engage_hri.schemas.tool_call import in_call
from engage_hri.schemas.world import Entity, World

EMPTY = "the world is empty"
"""Advice where there is nothing that could be named."""


def checked(fragment: TurnFragment, world: World, robot: str) -> TurnFragment:
    """The fragment with addressee and delay target filled in, and marks that look like offsets made explicit.

    robot: its actor id, which may be a target too.
    Raises InputRefused with JSON path and XML line of the first thing that is wrong, by itself or with regard to the
    world.
    """
    with _places_as_written(fragment):
        return _checked(fragment, world, robot)


def check_world(fragment: TurnFragment, world: World, robot: str) -> None:
    """Check again that the world has all that a checked fragment names. Raises InputRefused, as `checked`."""
    with _places_as_written(fragment):
        _check_targets(fragment, world, robot)


@contextmanager
def _places_as_written(fragment: TurnFragment) -> Iterator[None]:
    """Make faults in the body of `with` name the parts of the tool call, if the fragment was made from one."""
    try:
        yield
    except InputRefused as error:
        fault = replace(error.fault, where=in_call(error.fault.where, fragment))
        raise InputRefused(fault, error.block) from error


def _checked(fragment: TurnFragment, world: World, robot: str) -> TurnFragment:
    fragment = validated(fragment)
    for index, behavior in enumerate(fragment.behaviors):
        if isinstance(behavior, Speech) and len(behavior.text) > LONGEST_SPEECH:
            reason = f"{len(behavior.text)} characters of speech, at most {LONGEST_SPEECH} can be said in one go"
            advice = "say it in several pieces"
            raise _refused(fragment, f"$.behaviors[{index}].text", reason, behavior.line, advice)
    _check_targets(fragment, world, robot)
    for index, behavior in enumerate(fragment.behaviors):
        if isinstance(behavior, Reference):
            _check_timing(fragment, index, behavior)
    return replace(fragment, addressee=addressee(fragment, world), delay_target=_delay_target(fragment, world))


def _check_targets(fragment: TurnFragment, world: World, robot: str) -> None:
    known = {entity.id: entity for entity in world.entities}
    for path, target, line in _targets(fragment):
        if target not in known and target != robot:
            advice = suggestion(target, known, EMPTY)
            raise _refused(fragment, path, f"the world does not know {target!r}", line, advice)
    objects = {id: entity for id, entity in known.items() if entity.kind == "object"}
    for index, behavior in enumerate(fragment.behaviors):
        if isinstance(behavior, Reference):
            _check_objects(fragment, index, behavior, objects)


def lacks_people(fragment: TurnFragment, world: World) -> bool:
    """True if the fragment begins a turn, or names somebody to speak to, and the world has no people."""
    begins = fragment.turn_status not in ("middle", "end")
    return not world.people and (begins or bool(fragment.addressee))


def addressee(fragment: TurnFragment, world: World) -> str:
    """Id of the person spoken to: the one that is named, else the only one there is. Raises InputRefused.

    Empty for a `middle` or `end` that names nobody: the fragment that began the turn has named the addressee.
    """
    people = [person.id for person in world.people]
    if fragment.addressee:
        if fragment.addressee not in people:
            advice = f"people: {', '.join(people)}" if people else "the world knows nobody"
            reason = f"the world does not know the person {fragment.addressee!r}"
            raise _refused(fragment, "$.addressee", reason, fragment.line, advice)
        return fragment.addressee
    if fragment.turn_status in ("middle", "end"):
        return ""
    if len(people) != 1:
        reason = f"no addressee, and the world knows {len(people) or 'no'} people"
        advice = f"name one of {', '.join(people)}" if people else "the world needs a person to speak to"
        raise _refused(fragment, "$.addressee", reason, fragment.line, advice)
    return people[0]


def _delay_target(fragment: TurnFragment, world: World) -> str:
    """The entity to look at while the fragment holds the turn: the one it names, else the first surface.

    Empty if it does not hold the turn, or the world has no surface.
    """
    if not fragment.delay or fragment.delay_target:
        return fragment.delay_target
    return next((entity.id for entity in world.entities if entity.kind == "surface"), "")


def _check_objects(fragment: TurnFragment, index: int, reference: Reference, objects: Mapping[str, Entity]) -> None:
    if reference.target not in objects:
        reason = f"the world does not know the object {reference.target!r}"
        path = f"$.behaviors[{index}].target"
        raise _refused(fragment, path, reason, reference.line, suggestion(reference.target, objects, EMPTY))
    for number, option in enumerate(reference.options or ()):
        if objects.keys() >= set(option.distractors):
            continue
        for place, distractor in enumerate(option.distractors):
            if distractor not in objects:
                path = f"$.behaviors[{index}].options[{number}].distractors[{place}]"
                reason = f"the world does not know the object {distractor!r}"
                line = option.line or reference.line
                raise _refused(fragment, path, reason, line, suggestion(distractor, objects, EMPTY))


def _check_timing(fragment: TurnFragment, index: int, reference: Reference) -> None:
    for place, timing in enumerate(reference.timing):
        if timing.sync not in ("start", "end"):
            reason = f"a reference has no sync point {timing.sync!r}"
            path = f"$.behaviors[{index}].timing[{place}].sync"
            raise _refused(fragment, path, reason, reference.line, "it has 'start' and 'end'")
        if SyncRef.parse(timing.ref).behavior == reference.id:
            path = f"$.behaviors[{index}].timing[{place}].ref"
            raise _refused(fragment, path, "a reference cannot be timed by itself", reference.line, "")


def _targets(fragment: TurnFragment) -> Iterator[tuple[str, str, int]]:
    for index, behavior in enumerate(fragment.behaviors):
        if isinstance(behavior, Gaze | GazeShift | Pointing | HeadDirectionShift):
            yield f"$.behaviors[{index}].target", behavior.target, behavior.line
    if fragment.delay_target:
        yield "$.delay_target", fragment.delay_target, fragment.line


def _refused(fragment: TurnFragment, path: str, reason: str, line: int, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{fragment.id}: {path}", line=line, advice=advice))
