"""Fragments against the world: ids are spelled as it has them, words stand for what it lacks, a bad one is refused.

Between the writing of a fragment and its performance an object may leave, and a model may name what never was there.
A speaker says the words all the same: nothing else of the fragment is lost. Only a fragment of which nothing at all
could be performed is refused, as a whole, and the fault says where it is wrong; a piece of a turn never is, for that
would cost the rest of the turn. Pure.
"""

from collections.abc import Callable, Iterator, Mapping, Set
from contextlib import contextmanager
from string import ascii_letters, digits
from typing import Literal, NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.advice import in_other_letters, meant, suggestion
from engage_hri.schemas.behaviors import (
    FragmentBehavior,
    Looks,
    Pointing,
    Reference,
    Speech,
    SpeechOption,
    Wait,
)
from engage_hri.schemas.check import validated
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import EVERYBODY, TurnFragment
from engage_hri.schemas.references import SyncRef, rewritten
from engage_hri.schemas.tool import in_call
from engage_hri.schemas.world import TOGETHER, World, each_of
from engage_hri.services.generation.references.phrases import noun_in
from engage_hri.services.text.ear import heard, is_spoken
from engage_hri.services.text.marks import Piece, problems

Kind = Literal["entity", "object", "person"]
"""What may be named somewhere: whatever there is, the robot included; an object; a person."""
Ids = Mapping[Kind, Mapping[str, str]]
"""Ids, each with what it is, by where they may stand."""
Aimed = Looks | Pointing


class Name(NamedTuple):
    """An id in a fragment. path: its JSON path. line: of the XML source; 0: there is none."""

    id: str
    kind: Kind
    path: str
    line: int


def known(world: World, robot: str) -> Ids:
    """The ids that there are. robot: its actor id, which may be looked at, too."""
    return {
        "entity": {robot: "robot"} | {each.id: each.kind for each in world.entities},
        "object": {each.id: each.kind for each in world.objects},
        "person": {each.id: each.kind for each in world.people},
    }


def unknown(id: str, kind: Kind, ids: Ids) -> str:
    """Say in words that there is nothing of this id where `kind` is needed."""
    if (found := ids["entity"].get(id)) is not None:
        return f"{id!r} is a {found}, and no {kind} (`refer` takes objects)"
    return f"the world does not know {'the object ' if kind == 'object' else ''}{id!r}"


def renamed(fragment: TurnFragment, name: Callable[[Name], str]) -> TurnFragment:
    """The fragment with `name(each)` in place of each id. What is empty names nothing."""

    def named(id: str, kind: Kind, path: str, line: int) -> str:
        return name(Name(id, kind, path, line)) if id else id

    def target(together: str, kind: Kind, path: str, line: int) -> str:
        return TOGETHER.join(named(id, kind, path, line) for id in each_of(together))

    def option(each: SpeechOption, path: str, line: int) -> SpeechOption:
        ids = [
            named(id, "object", f"{path}.distractors[{place}]", each.line or line)
            for place, id in enumerate(each.distractors)
        ]
        return replace(each, distractors=tuple(ids))

    def behavior(each: FragmentBehavior, path: str) -> FragmentBehavior:
        if isinstance(each, Aimed):
            return replace(each, target=target(each.target, "entity", f"{path}.target", each.line))
        if not isinstance(each, Reference):
            return each
        options = [option(one, f"{path}.options[{n}]", each.line) for n, one in enumerate(each.options or ())]
        objects = target(each.target, "object", f"{path}.target", each.line)
        return replace(each, target=objects, options=None if each.options is None else tuple(options))

    def people(ids: str | tuple[str, ...], path: str) -> str | tuple[str, ...]:
        if isinstance(ids, str):
            return named(ids, "person", path, fragment.line)
        return tuple(named(id, "person", f"{path}[{n}]", fragment.line) for n, id in enumerate(ids))

    interrupting = fragment.interruptible
    if isinstance(interrupting, str | tuple):
        interrupting = people(interrupting, "$.interruptible")
    return replace(
        fragment,
        behaviors=tuple(behavior(each, f"$.behaviors[{n}]") for n, each in enumerate(fragment.behaviors)),
        addressee=people(fragment.addressee, "$.addressee"),
        interruptible=interrupting,
        delay_target=named(fragment.delay_target, "entity", "$.delay_target", fragment.line),
    )


def names(fragment: TurnFragment) -> list[Name]:
    """All ids that a fragment names, in order."""
    found: list[Name] = []

    def note(name: Name) -> str:
        found.append(name)
        return name.id

    renamed(fragment, note)
    return found


def spelled(fragment: TurnFragment, ids: Ids) -> tuple[TurnFragment, tuple[str, ...]]:
    """The fragment with ids as the world spells them, and a warning if it had other letters."""
    others: list[Piece] = []

    def as_known(name: Name) -> str:
        if name.id in ids[name.kind] or not (meant := in_other_letters(name.id, ids[name.kind])):
            return name.id
        others.append(Piece("left", name.id, 0, 0, "case"))
        return meant

    return renamed(fragment, as_known), problems(others)


_NAME = f"{ascii_letters}{digits}_"
"""Characters of the name of a sync point; an offset may follow it."""


def bearable(fragment: TurnFragment, world: World, robot: str) -> tuple[TurnFragment, tuple[str, ...]]:
    """The fragment without what the world does not know, with words in place of references to it, and warnings.

    Ids are spelled as the world spells them. Phrases that have no words, such as an emoji alone, are left out, too:
    they name nothing.
    """
    ids = known(world, robot)
    fragment, told = spelled(fragment, ids)
    warnings = list(told)
    behaviors = [_bearable(each, ids, warnings) for each in fragment.behaviors]
    is_piece = fragment.turn_status in ("beginning", "middle", "end")
    pairs = zip(fragment.behaviors, behaviors, strict=True)
    if not is_piece and not any(_is_performed(after) for before, after in pairs if type(after) is type(before)):
        return fragment, told  # what it names is refused, if that is wrong
    delay = fragment.delay_target
    if delay and delay not in ids["entity"]:
        warnings.append(f"{_unknown(delay, 'entity', ids)}; the robot looks elsewhere while it is silent")
        delay = ""
    left_out = {each.id for each in set(behaviors) - set(fragment.behaviors) if isinstance(each, Wait)}
    changed = replace(fragment, behaviors=tuple(behaviors), delay_target=delay)
    return _retied(changed, left_out) if left_out else changed, tuple(warnings)


def left_unsaid(fragment: TurnFragment) -> tuple[str, ...]:
    """Say what of a fragment's words is for the eye alone, and so is not said."""
    speeches = [each for each in fragment.behaviors if isinstance(each, Speech)]
    return tuple(f"{each.id}: {problem}" for each in speeches for problem in heard(each.text).problems)


def _is_performed(behavior: FragmentBehavior) -> bool:
    return is_spoken(behavior.text) if isinstance(behavior, Speech) else True


def _bearable(behavior: FragmentBehavior, ids: Ids, warnings: list[str]) -> FragmentBehavior:
    """The behavior, or what is done in its place; a wait takes no time, but others may be tied to it."""
    if isinstance(behavior, Reference):
        behavior = _with_words(behavior, ids, warnings)
        missing = _missing(behavior.target, "object", ids)
        return _as_speech(behavior, missing, ids, warnings) if missing else behavior
    if isinstance(behavior, Aimed) and (missing := _missing(behavior.target, "entity", ids)):
        warnings.append(f"{behavior.id}: {_unknown(missing, 'entity', ids)}; left out")
        begins = tuple(each for each in behavior.timing if each.sync == "start")
        return Wait(id=behavior.id, duration=0.0, timing=begins, line=behavior.line)
    return behavior


def _with_words(reference: Reference, ids: Ids, warnings: list[str]) -> Reference:
    """The reference with phrases that have words, to be told apart from objects that there are."""
    kept = []
    for each in reference.options or ():
        if each.text.strip() and not is_spoken(each.text):
            warnings.append(f"{reference.id}: no words in {each.text!r}")
            continue
        if gone := [id for id in each.distractors if id not in ids["object"]]:
            told = "; ".join(_unknown(id, "object", ids) for id in gone)
            warnings.append(f"{reference.id}: {told}; not taken for another one")
            each = replace(each, distractors=tuple(id for id in each.distractors if id in ids["object"]))
        kept.append(each)
    return reference if tuple(kept) == (reference.options or ()) else replace(reference, options=tuple(kept) or None)


def _missing(target: str, kind: Kind, ids: Ids) -> str:
    """The first of a target's ids that names nothing of this kind; "": all do."""
    return next((id for id in each_of(target) if id not in ids[kind]), "")


def _as_speech(reference: Reference, missing: str, ids: Ids, warnings: list[str]) -> Speech:
    nouns = " and ".join(filter(None, map(noun_in, each_of(reference.target))))
    text = next((each.text for each in reference.options or () if is_spoken(each.text)), nouns)
    how = f"only said: {text!r}" if text else "left out"
    warnings.append(f"{reference.id}: {_unknown(missing, 'object', ids)}; {how}")
    return Speech(id=reference.id, text=text, timing=reference.timing, line=reference.line)


def _retied(fragment: TurnFragment, gone: Set[str]) -> TurnFragment:
    """The fragment tied to the start of what is left out where it was tied to another point of that."""

    def to_start(ref: str) -> str:
        id, _, rest = ref.partition(":")
        return f"{id}:start{rest.lstrip(_NAME)}" if id in gone else ref

    return rewritten(fragment, to_start)


def _unknown(id: str, kind: Kind, ids: Ids) -> str:
    return f"{unknown(id, kind, ids)}{'' if id in ids['entity'] else meant(id, ids[kind])}"


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
        fragment = validated(fragment)
        _check_names(fragment, world, robot)
        for index, behavior in enumerate(fragment.behaviors):
            if isinstance(behavior, Reference):
                _check_timing(fragment, index, behavior)
        people = addressees(fragment, world)
        return replace(
            fragment,
            addressee=people if len(people) > 1 else "".join(people),
            delay_target=_delay_target(fragment, world),
        )


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


def addressees(fragment: TurnFragment, world: World) -> tuple[str, ...]:
    """Ids of those spoken to: those that are named, else the only one there is. Raises InputRefused.

    None for a `middle` or `end` that names nobody, or all: the fragment that began the turn has named its addressees.
    """
    people = [person.id for person in world.people]
    for name in names(fragment):
        if name.kind == "person" and name.id not in (*people, EVERYBODY):
            advice = f"people: {', '.join(people)}" if people else "the world knows nobody"
            raise _refused(fragment, name.path, f"the world does not know the person {name.id!r}", name.line, advice)
    is_to_all = EVERYBODY in fragment.addressees
    if fragment.turn_status in ("middle", "end") and (is_to_all or not fragment.addressees):
        return ()
    if fragment.addressees and not is_to_all:
        return fragment.addressees
    if len(people) != 1 and not (people and is_to_all):
        reason = f"no addressee, and the world knows {len(people) or 'no'} people"
        advice = f"name one of {', '.join(people)}" if people else "the world needs a person to speak to"
        raise _refused(fragment, "$.addressee", reason, fragment.line, advice)
    return tuple(people)


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
