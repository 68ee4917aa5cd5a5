"""Prepared fragments and blocks, which a person performs by a button or a key. Pure."""

from collections.abc import Sequence
from itertools import count

from msgspec import to_builtins
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import with_names
from engage_hri.schemas.text import joined
from engage_hri.schemas.tool import Part, Refer

Thing = Block | TurnFragment


class Script:
    """The prepared things, in order. Each performance gets an id of its own, for the same one may come again."""

    def __init__(self, things: tuple[Thing, ...] = ()) -> None:
        self._things = things
        self._numbers = count(1)

    def __len__(self) -> int:
        return len(self._things)

    @property
    def titles(self) -> tuple[str, ...]:
        """A title for each: its words and what it refers to, or its id."""
        return tuple(map(title, self._things))

    def take(self, number: int, addressee: str = "") -> Thing:
        """The thing at a place, with a new id. Raises IndexError if there is none.

        addressee: id of the person for whom a fragment is that names nobody.
        """
        thing = self._things[number]
        id = f"{thing.id}-{next(self._numbers)}"
        if isinstance(thing, Block):
            return with_names(thing, {thing.id: id})
        return replace(thing, id=id, addressee=thing.addressee or addressee)


def title(thing: Thing) -> str:
    """Words for a fragment or a block: what it says, with its references in brackets, or its id."""
    parts = []
    for behavior in thing.behaviors:
        match behavior:
            case Speech(text=text):
                parts.append(text)
            case Reference(target=target):
                parts.append(f"[{target}]")
    return joined(parts) or thing.id


def told(parts: Sequence[Part], target: str, asks: bool, addressee: str) -> dict[str, object]:
    """A turn as the tool of language models has it, and then what is meant. asks: the person is to answer."""
    whole = to_builtins([*parts, *([Refer(refer=target)] if target else [])])
    return {"turn_status": "full", "turn_index": 1 if asks else 3, "parts": whole, "addressee": addressee}


def backchannel(how: str, addressee: str = "") -> dict[str, object]:
    """A short sign that the robot listens. how: nod, or a word. addressee: empty: the only one."""
    part = {"gesture": "nod"} if how == "nod" else {"say": how}
    return {"turn_status": "backchannel", "parts": [part], "addressee": addressee}
