"""Ids of entities that a fragment names: one walk over all of them, which also replaces them. Pure."""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.advice import in_other_letters
from engage_hri.schemas.behaviors import (
    FragmentBehavior,
    Gaze,
    GazeShift,
    HeadDirectionShift,
    Pointing,
    Reference,
    SpeechOption,
)
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import World
from engage_hri.services.text.pieces import Piece, problems

Kind = Literal["entity", "object", "person"]
"""What may be named somewhere: whatever there is, the robot included; an object; a person."""
Ids = Mapping[Kind, Mapping[str, str]]
"""Ids, each with what it is, by where they may stand."""
Aimed = Gaze | GazeShift | HeadDirectionShift | Pointing


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

    def option(each: SpeechOption, path: str, line: int) -> SpeechOption:
        ids = [
            named(id, "object", f"{path}.distractors[{place}]", each.line or line)
            for place, id in enumerate(each.distractors)
        ]
        return replace(each, distractors=tuple(ids))

    def behavior(each: FragmentBehavior, path: str) -> FragmentBehavior:
        if isinstance(each, Aimed):
            return replace(each, target=named(each.target, "entity", f"{path}.target", each.line))
        if not isinstance(each, Reference):
            return each
        options = [option(one, f"{path}.options[{n}]", each.line) for n, one in enumerate(each.options or ())]
        target = named(each.target, "object", f"{path}.target", each.line)
        return replace(each, target=target, options=None if each.options is None else tuple(options))

    return replace(
        fragment,
        behaviors=tuple(behavior(each, f"$.behaviors[{n}]") for n, each in enumerate(fragment.behaviors)),
        addressee=named(fragment.addressee, "person", "$.addressee", fragment.line),
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
