"""Messages as they come to a reader: decoded (`Received`), and as they travel (`Sample`). Pure."""

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds


class Received(Struct, frozen=True):
    """A message as it arrived. source: the participant that published it. at: local time of arrival.

    life: of the process or connection that it came from, where that is known. past: the message is from before the
    subscription, given to a late subscriber as the class of its key says. number: of the message among the ordered
    ones of its life; 0 on a stream, and of a program without envelopes.
    """

    key: str
    message: Message
    source: str
    at: Seconds
    past: bool = False
    life: str = ""
    number: int = 0


class Sample(Struct, frozen=True):
    """A message as it travels, undecoded. source, at, life, past, number: as of `Received`.

    sent: when it was sent, on the clock `clock` of its sender; empty, and 0, of a program without envelopes.
    """

    key: str
    payload: bytes
    encoding: str
    source: str
    at: Seconds
    past: bool = False
    life: str = ""
    number: int = 0
    clock: str = ""
    sent: Seconds = 0.0


def sender_of(item: Received | Sample) -> str:
    """Name of its sender, as far as it is known: its process, and the requester in its key."""
    return f"{item.life} {keys.requester_of(item.key)}"
