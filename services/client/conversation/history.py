"""History of a conversation: what people have said, what the robot really said, which tools were called. Pure.

A model is told what has been said, and not what it has written: of words that were cut off it learns where. What it
wrote stays as it was as long as all of it was said, for it names objects in brackets, and a model that reads its
words back without them leaves them out the next time.
"""

from collections.abc import Iterable, Sequence
from typing import Literal

from msgspec import Struct, field

from engage_hri.schemas.units import Seconds


class ToolCall(Struct, kw_only=True):
    """A call of a tool by the model.

    id: by which its result is told. name: of the tool. arguments: as the model wrote them, JSON.
    result: as the model is told of it; empty: there is none yet.
    """

    id: str
    name: str
    arguments: str = ""
    result: str = ""


class PersonSaid(Struct, kw_only=True):
    """A turn of a person.

    who: id of the person. text: the words.
    began: seconds on this process' clock, as of `Robot.now`.
    to: ids of those to whom it was said; empty: nobody knows.
    is_sign: a listener's sign, a noise, or words for somebody else: nothing to answer.
    """

    who: str
    text: str
    began: Seconds
    to: tuple[str, ...] = ()
    is_sign: bool = False


class RobotSaid(Struct, kw_only=True):
    """A message of the model, as far as the robot has said it.

    to: id of the person.
    began: seconds on this process' clock: when its first word was over; before that, when it was asked for.
    said: the words that were spoken. written: the words as the model wrote them, without those in calls.
    unsaid: words of it that were not spoken; an object in brackets where its phrase was not.
    calls: of tools, in order.
    """

    to: str
    began: Seconds
    said: str = ""
    written: str = ""
    unsaid: str = ""
    calls: list[ToolCall] = field(default_factory=list)

    @property
    def is_cut(self) -> bool:
        """True if words were left unsaid."""
        return bool(self.unsaid)


Entry = PersonSaid | RobotSaid


class Spoken(Struct, frozen=True):
    """A message for a model. role: who wrote it, `results` for those of the calls of the message before."""

    role: Literal["user", "assistant", "results"]
    text: str = ""
    calls: tuple[ToolCall, ...] = ()


BEGINS = "(The conversation begins.)"


def messages(history: Iterable[Entry]) -> Sequence[Spoken]:
    """Write a history as messages: a person first, never two of the user one after the other."""
    entries = list(history)
    several = len({each.who for each in entries if isinstance(each, PersonSaid)}) > 1
    told: list[Spoken] = []
    heard: list[str] = [] if entries and isinstance(entries[0], PersonSaid) else [BEGINS]
    for entry in entries:
        if isinstance(entry, PersonSaid):
            aside = f" (to {', '.join(entry.to)})" if entry.is_sign and entry.to else ""
            heard.append(f"{entry.who}{aside}: {entry.text}" if several or aside else entry.text)
            continue
        if heard:
            told.append(Spoken("user", "\n".join(heard)))
            heard = []
        elif told and told[-1].role == "assistant":
            told.append(Spoken("user", "(Nothing was said.)"))
        text = entry.said if entry.is_cut else entry.written
        told.append(Spoken("assistant", text, tuple(entry.calls)))
        if entry.calls:
            told.append(Spoken("results", "", tuple(entry.calls)))
        if entry.is_cut:
            heard.append(f'(You were interrupted, and have not said: "{entry.unsaid}")')
    return [*told, Spoken("user", "\n".join(heard))] if heard else told
