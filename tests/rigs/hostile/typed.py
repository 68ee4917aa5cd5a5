"""Random messages from the message union itself: any value that its structs can hold, and some that they can't.

A field that is added to a message is filled from then on, without a change here.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any

import msgspec
import msgspec.inspect as shapes
from msgspec import Struct

from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from tests.rigs.hostile.chance import Chance, happens

SURROGATE = "\u2620"
"""Stands for half a surrogate pair, which no encoder takes: `payloads` replaces its bytes."""
NASTY_TEXTS = (
    "", " ", "\0", "a/b", "*", "**", "$*", "?", "#", "@bus", "~2", "bml", ":", "a:b:c", "x" * 300, "long " * 4000,
    "\u202e", "e\u0301", "\U0001f916", SURROGATE, "<sync/>", "]]>", "nan", "-1", "None", "..", "all",
)  # fmt: skip
NASTY_FLOATS = (
    float("nan"), float("inf"), float("-inf"), 1e308, -1e308, 5e-324, -0.0, 0.0, -1.0, -1e-9, 1e-9, 1e9, 1e16,
)  # fmt: skip
NASTY_INTS = (0, -1, 1, 2, 255, 2**31, -(2**31), 2**53 + 1, 2**63 - 1, -(2**63))
REMEMBERED = 24
"""Number of words remembered for each field."""
DEEPEST = 5
NASTINESS = (0.0, 0.05, 0.3, 0.9)


class Words:
    """Strings that fields of each name have held on this bus: a message with known names gets further than noise."""

    def __init__(self) -> None:
        self._heard: dict[str, deque[str]] = {}

    def hear(self, thing: object, depth: int = 0) -> None:
        """Remember the strings in a message."""
        if isinstance(thing, tuple) and depth < DEEPEST:
            for item in thing[:4]:
                self.hear(item, depth + 1)
        elif isinstance(thing, Struct) and depth < DEEPEST:
            for name in thing.__struct_fields__:
                value = getattr(thing, name)
                if isinstance(value, str):
                    if 0 < len(value) <= 120:
                        self.add(name, value)
                else:
                    self.hear(value, depth + 1)

    def add(self, field: str, word: str) -> None:
        known = self._heard.setdefault(field, deque(maxlen=REMEMBERED))
        if word not in known:
            known.append(word)

    def of(self, field: str) -> Sequence[str]:
        return self._heard.get(field, ())


_UNION = shapes.type_info(Message)
assert isinstance(_UNION, shapes.UnionType)
KINDS = {kind.cls.__name__: kind for kind in _UNION.types if isinstance(kind, shapes.StructType)}
"""Types of all messages that may travel on the bus, by the name of their class."""


class RandomMessages:
    """Makes random messages. Each has its own share of nasty fields, which hold what only their type allows."""

    def __init__(self, chance: Chance, words: Words) -> None:
        self._chance = chance
        self._words = words
        self._nastiness = 0.0
        self._now: Seconds = 0.0

    def message(self, now: Seconds, kind: str = "") -> Message:
        """Make a message. It may break bounds of its fields, and then not decode. kind: its class; empty: any."""
        self._now = now
        self._nastiness = self._chance.choice(NASTINESS)
        name = kind or self._chance.choice(tuple(KINDS))
        made: Message = self._value(KINDS[name], "", 0)
        return made

    def _value(self, kind: shapes.Type, field: str, depth: int) -> Any:
        nasty = happens(self._chance, self._nastiness)
        match kind:
            case shapes.Metadata(type=inner):
                return self._value(inner, field, depth)
            case shapes.StructType():
                return self._struct(kind, depth)
            case shapes.UnionType(types=types):
                return self._value(self._one_of(types, depth), field, depth)
            case shapes.LiteralType(values=values):
                return self._chance.choice(values)
            case shapes.VarTupleType(item_type=item):
                most = 0 if depth >= DEEPEST else 12 if nasty else 3
                return tuple(self._value(item, field, depth + 1) for _ in range(self._chance.randrange(0, most + 1)))
            case shapes.TupleType(item_types=items):
                return tuple(self._value(item, field, depth + 1) for item in items)
            case shapes.StrType():
                return self._chance.choice(NASTY_TEXTS) if nasty else self._word(field)
            case shapes.FloatType(ge=least, le=most):
                if nasty:
                    return self._chance.choice(NASTY_FLOATS)
                if least is not None and most is not None:
                    return self._chance.uniform(least, most)
                return self._now + self._chance.uniform(-2.0, 2.0) if field == "seconds" else self._moderate()
            case shapes.IntType(ge=least):
                return self._chance.choice(NASTY_INTS) if nasty else (least or 0) + self._chance.randrange(0, 4)
            case shapes.BytesType():  # sound: two bytes for each sample
                return b"\x01\x80" * self._chance.randrange(0, 20000 if nasty else 4)
            case shapes.BoolType():
                return happens(self._chance, 0.5)
            case shapes.NoneType():
                return None
            case shapes.AnyType():  # what a ledger has taken: it is read by nobody but its own service
                return self._chance.choice((None, 1, self._word(field), {"type": self._word(field)}))
        raise TypeError(f"the vocabulary has a type that is new to `hostile`: {kind}")

    def _one_of(self, types: Sequence[shapes.Type], depth: int) -> shapes.Type:
        small = [kind for kind in types if isinstance(kind, shapes.NoneType)]
        return self._chance.choice(small if small and depth >= DEEPEST else types)

    def _moderate(self) -> float:
        return self._chance.choice((0.0, 0.5, 1.0, self._chance.uniform(0.0, 5.0)))

    def _word(self, field: str) -> str:
        if field == "clock" and happens(self._chance, 0.9):
            return "loop"
        known = self._words.of(field)
        if known and happens(self._chance, 0.8):
            return self._chance.choice(known)
        return self._chance.choice(("1", "2", "a", "start", "stroke", "end", "person", "robot", "realizer", "b:g"))

    def _struct(self, kind: shapes.StructType, depth: int) -> Struct:
        fields = {}
        for field in kind.fields:
            if field.required or happens(self._chance, 0.5):
                fields[field.name] = self._value(field.type, field.name, depth + 1)
        try:
            made: Struct = kind.cls(**fields)
        except ValueError:  # a struct that checks itself: what it refuses is left to `distorted`
            self._nastiness, before = 0.0, self._nastiness
            made = self._struct(kind, depth)
            self._nastiness = before
        return made


def distorted(chance: Chance, message: Message) -> Any:
    """Turn a message into plain data in which one thing has the wrong type, is missing, or is too much."""
    plain = msgspec.to_builtins(message)
    spots: list[tuple[Any, Any]] = []
    _collect(plain, spots)
    holder, place = chance.choice(spots)
    what = chance.randrange(0, 5)
    if what == 0 and isinstance(holder, dict):
        del holder[place]
    elif what == 1 and isinstance(holder, dict):
        holder[chance.choice(("type", "id", "extra", ""))] = chance.choice(("", 0, None, []))
    elif what == 2:
        holder[place] = [holder[place]] * 3
    elif what == 3 and (floats := [spot for spot in spots if isinstance(spot[0][spot[1]], float)]):
        holder, place = chance.choice(floats)
        holder[place] = chance.choice(NASTY_FLOATS)
    else:
        holder[place] = chance.choice(("", "text", 0, -1, 1.5, None, True, [], {}, [[]], {"type": "block"}, 2**70))
    return plain


def _collect(plain: Any, spots: list[tuple[Any, Any]]) -> None:
    """Collect every place in `plain` that can be changed, as its holder and its key or index."""
    items = plain.items() if isinstance(plain, dict) else enumerate(plain) if isinstance(plain, list) else ()
    for place, value in list(items):
        spots.append((plain, place))
        _collect(value, spots)
