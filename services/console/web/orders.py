"""Orders: what a page sends when somebody takes part, which right each needs, and what it can have performed.

Pure. `seat`: to be a person. `speak`: to drive the robot by hand. `steer`: to hold and stop it. `faults`: to switch
faults of a simulated body. `condition`: to set the condition of a study.
"""

from collections.abc import Sequence
from itertools import count
from typing import Annotated, ClassVar, Literal

import msgspec
from msgspec import Meta, Struct, to_builtins
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment, condition_words
from engage_hri.schemas.perception import LONGEST_TEXT
from engage_hri.schemas.references import with_names
from engage_hri.schemas.text import joined
from engage_hri.schemas.tool import Part, Refer
from engage_hri.schemas.units import Coordinate

Panel = Literal["part", "wizard", "player"]
"""Panel in which an order was given: the seat, the robot by hand, or the bar of a recording."""
Right = Literal["seat", "speak", "steer", "faults", "condition"]
ALL_RIGHTS: tuple[Right, ...] = ("seat", "speak", "steer", "faults", "condition")
RIGHTS: dict[str, tuple[Right, ...]] = {
    "operator": ("steer", "faults", "condition"),
    "wizard": ALL_RIGHTS,
}
"""Rights by role; no other role has any."""
GAZE = {"hold": "where it is", "release": "at rest", "target": "on "}
"""How the gaze is kept, in words."""
Name = Annotated[str, Meta(max_length=80)]
Id = Annotated[str, Meta(max_length=200)]
Text = Annotated[str, Meta(min_length=1, max_length=LONGEST_TEXT)]


class PageOrder(Struct, frozen=True, kw_only=True, tag_field="do", omit_defaults=True):
    """Order of a page. needs: the right that it takes; empty: none."""

    needs: ClassVar[Right | Literal[""]] = ""


class SeatOrder(PageOrder, frozen=True, kw_only=True):
    """Order of somebody who is a person, or wants to be."""

    needs: ClassVar[Right] = "seat"


class SitOrder(SeatOrder, frozen=True, kw_only=True, tag="sit"):
    """Become a person. name: id of the person; empty: one is made up."""

    name: Name = ""


class LeaveOrder(SeatOrder, frozen=True, kw_only=True, tag="leave"):
    """Stand up and go."""


class LookOrder(SeatOrder, frozen=True, kw_only=True, tag="look"):
    """Look at an entity; empty: away from everything."""

    target: Id = ""


class PointAt(SeatOrder, frozen=True, kw_only=True, tag="point"):
    """Point at an entity."""

    target: Id


class MoveHead(SeatOrder, frozen=True, kw_only=True, tag="head"):
    """Nod, or shake the head."""

    how: Literal["nod", "shake"] = "nod"


class Move(SeatOrder, frozen=True, kw_only=True, tag="move"):
    """Take a thing, and lay it there."""

    thing: Id
    x: Coordinate
    y: Coordinate


class Speak(SeatOrder, frozen=True, kw_only=True, tag="speak"):
    """Begin or end to speak, without words."""

    on: bool


class Type(SeatOrder, frozen=True, kw_only=True, tag="type"):
    """Say words."""

    text: Text


class WizardOrder(PageOrder, frozen=True, kw_only=True):
    """Order of somebody who drives the robot by hand. by: who it is, for the log."""

    needs: ClassVar[Right] = "speak"
    by: Name = ""


class Tell(WizardOrder, frozen=True, kw_only=True, tag="tell"):
    """Say words, and then what the target is, if there is one. asks: the person is to answer.

    addressee: ids of the people; empty: whoever is there. interruptible, interruptible_after: as in `ToolInput`.
    """

    text: Annotated[str, Meta(max_length=LONGEST_TEXT)] = ""
    target: Id = ""
    asks: bool = False
    addressee: tuple[Id, ...] = ()
    interruptible: bool | Id = ""
    interruptible_after: Literal[0, 1, 2, 4] = 0


class Prepared(WizardOrder, frozen=True, kw_only=True, tag="prepared"):
    """Perform a fragment of the script. number: its place there, from 0. addressee: if the fragment names nobody."""

    number: Annotated[int, Meta(ge=0)]
    addressee: tuple[Id, ...] = ()


class BackchannelOrder(WizardOrder, frozen=True, kw_only=True, tag="backchannel"):
    """Show that the robot listens. how: by a nod or a word."""

    how: Literal["nod", "uh-huh"] = "nod"
    addressee: tuple[Id, ...] = ()


class InhibitGaze(WizardOrder, frozen=True, kw_only=True, tag="inhibit"):
    """Keep the gaze from what fragments want, or let it go. target: with mode `target`."""

    on: bool
    mode: Literal["hold", "release", "target"] = "hold"
    target: Id = ""


class ConditionOrder(WizardOrder, frozen=True, kw_only=True, tag="condition"):
    """Begin a condition of a study. speech_only: the robot says the task's words and does nothing else."""

    needs: ClassVar[Right] = "condition"
    name: Name = ""
    speech_only: bool = False


class SteerOrder(PageOrder, frozen=True, kw_only=True, tag="steer"):
    """Hold, continue or stop all that the robot performs."""

    needs: ClassVar[Right] = "steer"
    to: Literal["hold", "continue", "stop"]
    by: Name = ""


class SwitchOrder(PageOrder, frozen=True, kw_only=True, tag="faults"):
    """Switch a fault of the body on, or off; all others stay as they are, whoever has switched them.

    off: all of its kind go off that have the fields which it has.
    """

    needs: ClassVar[Right] = "faults"
    fault: BodyFault
    off: bool = False
    by: Name = ""


class Play(PageOrder, frozen=True, kw_only=True, tag="play"):
    """Play a recording, or stand still in it.

    at: where to go first, in seconds; None: nowhere. speed: times as fast as it was; None: as before.
    """

    on: bool = True
    at: Annotated[float, Meta(ge=0)] | None = None
    speed: Annotated[float, Meta(ge=0.1, le=20)] | None = None


AnyOrder = (
    SitOrder | LeaveOrder | LookOrder | PointAt | MoveHead | Move | Speak | Type
    | Tell | Prepared | BackchannelOrder | InhibitGaze | ConditionOrder | SteerOrder | SwitchOrder
)  # fmt: skip


class Drawn(Struct, frozen=True, tag_field="do", tag="drawn"):
    """Said after each frame: it is on the screen."""


class Given(Struct, frozen=True, kw_only=True, tag_field="do", tag="order"):
    """An order on its way. number: its place among all of its page, from 1.

    until: seconds of the picture (`Frame.now`) after which it is too old to be obeyed; None: it never is.
    """

    number: Annotated[int, Meta(ge=1)]
    until: float | None = None
    order: msgspec.Raw


_messages: "msgspec.json.Decoder[Drawn | Given]" = msgspec.json.Decoder(Drawn | Given)
_orders: "msgspec.json.Decoder[AnyOrder]" = msgspec.json.Decoder(AnyOrder)
_played: "msgspec.json.Decoder[Play]" = msgspec.json.Decoder(Play)
_UNREADABLE = (msgspec.DecodeError, UnicodeDecodeError, RecursionError)


def message(text: str | bytes) -> Drawn | Given:
    """Read what a page says. Raises InputRefused for what is nothing of it."""
    try:
        return _messages.decode(text)
    except _UNREADABLE as error:
        raise InputRefused(Fault(reason=str(error), where="message", advice="reload the page")) from error


def decoded(text: str | bytes | msgspec.Raw) -> AnyOrder:
    """Read an order. Raises InputRefused for what is none."""
    try:
        return _orders.decode(text)
    except _UNREADABLE as error:
        raise InputRefused(Fault(reason=str(error), where="order", advice="reload the page")) from error


def decoded_in_recording(text: str | bytes | msgspec.Raw) -> Play:
    """Read an order of a page that shows a recording. Raises InputRefused for what is none."""
    try:
        return _played.decode(text)
    except _UNREADABLE as error:
        raise InputRefused(Fault(reason="it can only be played", where="this is a recording")) from error


def panel(order: PageOrder) -> Panel:
    """The panel in which an order is given."""
    return "part" if order.needs == "seat" else "wizard"


def server(order: PageOrder) -> str:
    """The service that carries an order out; empty: none has to."""
    match order:
        case SteerOrder():
            return "realizer"
        case SwitchOrder():
            return "control"
        case InhibitGaze(on=False):
            return ""
        case WizardOrder():
            return "generation"
    return ""


def denied(role: str, trusted: bool, *, keyed: bool = False, stage: bool = False) -> dict[str, str]:
    """The rights that a page does not have, each with the reason.

    trusted: the page was called with the token. keyed: the role is that of the window's keys. stage: it is one of
    the stage, whose visitors sit down and no more.
    """
    if role in RIGHTS and not trusted:
        reason = "this address lacks the token of this window: open the one that `engage console` printed last"
        return dict[str, str].fromkeys(ALL_RIGHTS, reason)
    found: dict[str, str] = {}
    for right in ALL_RIGHTS:
        if stage and right != "seat":
            found[right] = "the stage is for visitors; the workshop has this"
        elif right not in RIGHTS.get(role, ()):
            able = " or ".join(name for name, has in RIGHTS.items() if right in has)
            if keyed:
                found[right] = f"the window has keys of the role {role}; start it with those of {able}"
            else:
                found[right] = f"the window has the role {role}; start it with `--role` {able}"
    return found


def written(order: PageOrder) -> str:
    """An order in words, for the log, without what is said."""
    match order:
        case Tell(text=text, target=target, asks=asks):
            about = f" about {target}" if target else ""
            return f"{'asks' if asks else 'says'} {len(text)} characters{about}"
        case Prepared(number=number):
            return f"performs fragment {number + 1} of the script"
        case BackchannelOrder(how=how):
            return f"backchannel: {how}"
        case InhibitGaze(on=on, mode=mode, target=target):
            return f"keeps the gaze {GAZE[mode]}{target}" if on else "lets the gaze go"
        case ConditionOrder(name=name, speech_only=speech_only):
            return f"condition: {condition_words(name, speech_only)}"
        case SteerOrder(to=to):
            return to
        case SwitchOrder(fault=fault, off=off):
            return f"fault {'off' if off else 'on'}: {fault.kind}"
    return ""


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

    def take(self, number: int, addressee: tuple[str, ...] = ()) -> Thing:
        """The thing at a place, with a new id. Raises IndexError if there is none.

        addressee: ids of the people for whom a fragment is that names nobody.
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


def told(order: Tell, parts: Sequence[Part]) -> dict[str, object]:
    """A turn as the tool of language models has it. parts: its words; then comes what is meant."""
    whole = to_builtins([*parts, *([Refer(refer=order.target)] if order.target else [])])
    return {
        "turn_status": "full", "turn_index": 1 if order.asks else 3, "parts": whole, "addressee": order.addressee,
        "interruptible": order.interruptible, "interruptible_after": order.interruptible_after,
    }  # fmt: skip


def backchannel(how: str, addressee: tuple[str, ...] = ()) -> dict[str, object]:
    """A short sign that the robot listens. how: nod, or a word. addressee: empty: whoever is there."""
    part = {"gesture": "nod"} if how == "nod" else {"say": how}
    return {"turn_status": "backchannel", "parts": [part], "addressee": addressee}
