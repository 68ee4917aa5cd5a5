"""Orders and news on a link on which a program writes turns bit by bit. Pure.

A turn begins with the first text or part, or with `begin`, which says what concerns all of it. Text may come in
whatever bits; `[id]` in it refers to an object. `end` says that all is written: the turn goes on until it is said.
"""

from typing import Any

import msgspec
from msgspec import Raw, Struct

from engage_hri.schemas.faults import InputRefused, raised_as
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.tool import PARTS, Part, ToolInput


class WritingOrder(Struct, frozen=True, kw_only=True, tag_field="do", forbid_unknown_fields=True):
    """Order of a program."""


class BeginTurn(WritingOrder, frozen=True, kw_only=True, tag="begin"):
    """Begin a turn. turn: what concerns all of it: fields of `ToolInput` without its status and parts.

    await_answer: tell of its end when it has been answered, or it is too late.
    """

    turn: dict[str, Any] = {}
    await_answer: bool = False

    def options(self) -> ToolInput:
        """Read `turn`. Raises InputRefused."""
        with raised_as(InputRefused, msgspec.ValidationError, "turn"):
            return msgspec.convert({**self.turn, "turn_status": "full", "parts": ()}, ToolInput)


class WriteText(WritingOrder, frozen=True, kw_only=True, tag="text"):
    """Say this next. text: in whatever bits it comes."""

    text: str


class WritePart(WritingOrder, frozen=True, kw_only=True, tag="part"):
    """Say or do this next. part: one of `say`, `refer`, `look`, `gesture`, as in the tool of language models."""

    part: Raw

    def read(self) -> Part:
        """Read the part. Raises InputRefused."""
        advice = "one of say, refer, look, gesture"
        with raised_as(InputRefused, (msgspec.DecodeError, RecursionError), "part", advice=advice):
            named = msgspec.json.decode(self.part, type=dict[str, Any])
            kind = next((each for each in PARTS if each.__struct_fields__[0] in named), PARTS[0])
            return msgspec.json.decode(self.part, type=kind)


class EndTurn(WritingOrder, frozen=True, kw_only=True, tag="end"):
    """All of the turn is written."""


class StopTurn(WritingOrder, frozen=True, kw_only=True, tag="stop"):
    """End the turn at the next word."""


class HoldTurn(WritingOrder, frozen=True, kw_only=True, tag="hold"):
    """Wait at the next word."""


class ResumeTurn(WritingOrder, frozen=True, kw_only=True, tag="resume"):
    """Go on from there."""


AnyWritingOrder = BeginTurn | WriteText | WritePart | EndTurn | StopTurn | HoldTurn | ResumeTurn


class TurnNews(Struct, frozen=True, kw_only=True, tag_field="type"):
    """News of a turn. turn: its id."""

    turn: str


class TurnStarted(TurnNews, frozen=True, kw_only=True, tag="started"):
    """The robot has begun to perform it."""


class WordSounded(TurnNews, frozen=True, kw_only=True, tag="word"):
    """A word has been said. said: all words of the turn so far."""

    word: str
    said: str


class TurnHeld(TurnNews, frozen=True, kw_only=True, tag="held"):
    """The turn waits."""


class TurnResumed(TurnNews, frozen=True, kw_only=True, tag="resumed"):
    """The turn goes on."""


class TurnOver(TurnNews, frozen=True, kw_only=True, tag="over"):
    """Nothing more is said. summary: what became of it, cut words and looks among it."""

    summary: Summary


_orders: "msgspec.json.Decoder[AnyWritingOrder]" = msgspec.json.Decoder(AnyWritingOrder)


def order(text: str) -> AnyWritingOrder:
    """Read what a program says. Raises InputRefused for what is no order."""
    unreadable = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)
    with raised_as(InputRefused, unreadable, "order", advice="docs/other-languages.md has them"):
        return _orders.decode(text)
