"""Checks of a fragment before anything of it is performed: it is sound, and the world knows all that it names.

A bad fragment is refused as a whole, and the fault says where it is wrong.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.behaviors import Reference
from engage_hri.schemas.check import validated
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import SyncRef
from engage_hri.schemas.tool import in_call
from engage_hri.schemas.world import World
from engage_hri.services.generation.lost import bearable, left_unsaid
from engage_hri.services.generation.names import known, names, spelled, unknown

EMPTY = "the world is empty"
"""Advice where there is nothing that could be named."""


def performable(fragment: TurnFragment, world: World, robot: str) -> tuple[TurnFragment, tuple[str, ...]]:
    """The checked fragment, as it will be performed, and warnings of what of it will not.

    Raises InputRefused, as `checked`.
    """
    fragment, lost = bearable(fragment, world, robot)
    fragment = checked(fragment, world, robot)
    return fragment, (*lost, *left_unsaid(fragment))


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
        _check_names(fragment, world, robot)


@contextmanager
def _places_as_written(fragment: TurnFragment) -> Iterator[None]:
    """Make faults in the body of `with` name the parts of the tool call, if the fragment was made from one."""
    try:
        yield
    except InputRefused as error:
        fault = replace(error.fault, where=in_call(error.fault.where, fragment))
        raise InputRefused(fault, error.block) from error


def _checked(fragment: TurnFragment, world: World, robot: str) -> TurnFragment:
    fragment, _ = spelled(validated(fragment), known(world, robot))
    _check_names(fragment, world, robot)
    for index, behavior in enumerate(fragment.behaviors):
        if isinstance(behavior, Reference):
            _check_timing(fragment, index, behavior)
    return replace(fragment, addressee=addressee(fragment, world), delay_target=_delay_target(fragment, world))


def _check_names(fragment: TurnFragment, world: World, robot: str) -> None:
    ids = known(world, robot)
    for name in names(fragment):
        if name.kind != "person" and name.id not in ids[name.kind]:
            reason = unknown(name.id, name.kind, ids)
            advice = suggestion(name.id, ids[name.kind].keys() - {robot}, EMPTY)
            raise _refused(fragment, name.path, reason, name.line, advice)


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


def _check_timing(fragment: TurnFragment, index: int, reference: Reference) -> None:
    for place, timing in enumerate(reference.timing):
        if timing.sync not in ("start", "end"):
            reason = f"a reference has no sync point {timing.sync!r}"
            path = f"$.behaviors[{index}].timing[{place}].sync"
            raise _refused(fragment, path, reason, reference.line, "it has 'start' and 'end'")
        if SyncRef.parse(timing.ref).behavior == reference.id:
            path = f"$.behaviors[{index}].timing[{place}].ref"
            raise _refused(fragment, path, "a reference cannot be timed by itself", reference.line, "")


def _refused(fragment: TurnFragment, path: str, reason: str, line: int, advice: str) -> InputRefused:
    return InputRefused(Fault(reason=reason, where=f"{fragment.id}: {path}", line=line, advice=advice))
