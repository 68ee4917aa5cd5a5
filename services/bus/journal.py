"""Log lines for messages as they are published, and for peers that come and go. Spoken words are in none.

A line for each block, fragment and turn that has ended, each connection event that is decided, each person and peer
that comes or goes, each warning and refusal, and for what is held; at level DEBUG one for every message but the
streams and the state of the body. Loggers are named `engage.<service>`, or `engage.<role>` for a participant that is
no service.
"""

import logging
from collections.abc import Callable, Iterable
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockProgress, BodyHeld, Held, Hold, WarningFeedback
from engage_hri.schemas.body_faults import BodyFaults, words
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import FragmentOutcome, StudyCondition, TurnClosed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActorFound, ActorLost
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent
from engage_hri.schemas.requests import Refused
from engage_hri.schemas.units import Seconds

DEBUG, INFO, WARNING = logging.DEBUG, logging.INFO, logging.WARNING
Entry = tuple[int, str]
"""Level and text."""


NAMED = (*keys.SERVICES, "simulation", "collaboration")
"""Services, each with a log of its own. Other participants, which come and go, share one by role."""
PEERS = logging.getLogger("engage.peers")
"""Who comes and goes."""


def logger(name: str, role: str) -> logging.Logger:
    """Return the log of a participant."""
    return logging.getLogger(f"engage.{name if name in NAMED else role}")


ALERT = "alert"
"""Attribute of a record that says what a person has to see to, or that it is over: commands that serve print it."""


def alert(log: logging.Logger, text: str, *arguments: object) -> None:
    """Write what a person has to see to, or that it is over. text: as of `Logger.warning`."""
    log.warning(text, *arguments, extra={ALERT: True})


def entry(message: Message) -> Entry:
    """Return the line for a message that is published."""
    tell = _TOLD.get(type(message))
    return tell(message) if tell else _any(message)


def presence(message: PeerAlive | PeerGone) -> Entry:
    """Return the line for a participant that has come or gone."""
    if isinstance(message, PeerGone):
        return INFO, f"peer {message.participant}: gone"
    return INFO, f"peer {message.participant}: here, life {message.run or 'unknown'}"


def _any(message: Message) -> Entry:
    config = message.__struct_config__
    about = getattr(message, "id", "") or getattr(message, "block", "")
    return DEBUG, f"{config.tag} {about}".rstrip()


def _block(message: BlockProgress) -> Entry:
    if message.progress == "start":
        return DEBUG, f"block {message.block}: started"
    return INFO, f"block {message.block}: {message.status} after {_seconds(message.time)}"


def _warning(message: WarningFeedback) -> Entry:
    place = f"block {message.place}" if message.place else "no block"
    return WARNING, f"{place}: {message.kind}: {message.message}"


def _fragment(message: FragmentOutcome) -> Entry:
    text = f"fragment {message.fragment} of {message.requester}: {message.status}"
    if message.fault:
        return INFO, f"{text}: {message.fault}"
    return INFO, f"{text}, replaced by {message.replaced_by}" if message.replaced_by else text


def _turn(message: TurnClosed) -> Entry:
    reason = f" ({message.reason})" if message.reason else ""
    people = ", ".join((message.addressee, *message.others))
    return INFO, f"turn {message.turn} to {people}: {message.status}{reason}"


def _event(message: ConnectionEvent) -> Entry:
    if message.retold:
        return DEBUG, f"event {message.id}: told again, of {message.initiator} and {message.responder}, words and all"
    level = INFO if message.state == "succeeded" or message.state in ENDINGS - {"completed"} else DEBUG
    delay = "" if message.delay is None else f" after {_seconds(message.delay)}"
    about = f" about {', '.join(message.objects)}" if message.objects else ""
    who = f"{message.initiator} to {message.responder}"
    return level, f"event {message.id}: {message.kind} from {who}{about}: {message.state}{delay}"


def _held(message: Held) -> Entry:
    return INFO if message.holds else DEBUG, f"held: {_names(message.holds)}"


def _body_held(message: BodyHeld) -> Entry:
    text = "; ".join((f"held, since nobody renews it: {_names(message.holds)}", *message.reasons))
    return WARNING if message.holds else DEBUG, text


def _body_faults(message: BodyFaults) -> Entry:
    return (
        WARNING if message.faults else DEBUG,
        f"faults switched on: {', '.join(map(words, message.faults)) or 'none'}",
    )


def _condition(message: StudyCondition) -> Entry:
    return INFO if message.by else DEBUG, message.sentence


def _names(holds: Iterable[Hold]) -> str:
    names = [": ".join(filter(None, (each.block, each.behavior))) or "everything" for each in holds]
    return ", ".join(names) or "nothing"


def _refused(message: Refused) -> Entry:
    return WARNING, f"refused {message.kind} {message.id} of {message.requester}: {message.fault}"


def _fault(message: Fault) -> Entry:
    return DEBUG, "fault told"  # the participant that tells of a fault has logged it, with its traceback


def _actor(message: ActorFound | ActorLost) -> Entry:
    return INFO, f"person {message.actor}: {'here' if isinstance(message, ActorFound) else 'gone'}"


def _seconds(value: Seconds) -> str:
    return f"{value:.2f} s"


_TOLD: dict[type, Callable[[Any], Entry]] = {
    BlockProgress: _block,
    WarningFeedback: _warning,
    FragmentOutcome: _fragment,
    TurnClosed: _turn,
    ConnectionEvent: _event,
    Held: _held,
    BodyHeld: _body_held,
    BodyFaults: _body_faults,
    StudyCondition: _condition,
    Refused: _refused,
    Fault: _fault,
    ActorFound: _actor,
    ActorLost: _actor,
}


def note(log: logging.Logger, key: str, message: Message) -> None:
    """Write the line of a message that is published under the key. Most messages have none, which is seen at once."""
    if type(message) in _TOLD or (log.isEnabledFor(DEBUG) and not _is_measured(key)):
        log.log(*entry(message))


def _is_measured(key: str) -> bool:
    """True for what comes many times a second and says nothing new by itself."""
    return keys.key_class(key) == "stream" or key in (keys.ROBOT_STATE, keys.ROBOT_SEEN)


def note_presence(message: PeerAlive | PeerGone, viewer: str = "") -> None:
    """Write the line of a participant that has come or gone, as `viewer` sees it; empty: as all see it."""
    level, text = presence(message)
    PEERS.log(level, f"{text}; seen by {viewer}" if viewer else text)
