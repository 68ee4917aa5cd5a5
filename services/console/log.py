"""The same news as plain lines, one per thing that matters: for a log file, a pipe, or a screen reader."""

from msgspec import Struct

from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.attention import HeadOwner
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.feedback import BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import wording
from engage_hri.services.console.view import OWN_BLOCKS, Scene


class Telling(Struct, frozen=True, kw_only=True):
    """What the log tells. actions: what people and the robot do; points: sync points; head: who owns the head;
    statistics: statistics; warnings: of the realizer and of the policies.
    """

    actions: bool = True
    points: bool = True
    head: bool = True
    statistics: bool = False
    warnings: bool = True


def told(message: Message, before: Scene, after: Scene, at: Seconds, telling: Telling) -> str | None:
    """The line for one message, None for most. before, after: the scene around it. at: the instant it speaks of."""
    text = _text(message, before, after, telling)
    return None if text is None else f"{wording.clock(at - after.began):>8}  {text}"


def _text(message: Message, before: Scene, after: Scene, telling: Telling) -> str | None:
    match message:
        case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
            return _action(message, before) if telling.actions else None
        case SyncPointProgress(block=block) if telling.points and not block.startswith(OWN_BLOCKS):
            planned = "" if message.predicted is None else f" (planned {wording.seconds(message.predicted)})"
            return f"{block}:{message.behavior}:{message.sync} at {wording.seconds(message.time)}{planned}"
        case ConnectionEvent(state=state) if state != "completed":
            about = f" about {wording.names(message.objects)}" if message.objects else ""
            who = f"{message.initiator} → {message.responder}"
            kind = wording.KINDS[message.kind]
            return f"* {kind}, {who}{about} ({message.cause}): {wording.decision(message)}"
        case Statistics() if telling.statistics:
            return wording.statistics(message)
        case HeadOwner() if telling.head:
            waiting = wording.names([claim.kind for claim in message.waiting])
            return f"head: {wording.claim(message.owner)}" + (f"; waiting: {waiting}" if waiting else "")
        case BlockProgress(progress="end", block=str() as block) if not block.startswith(OWN_BLOCKS):
            return f"block {block}: {message.status}"
        case WarningFeedback() if telling.warnings:
            return wording.warning(message)
        case Fault():
            return f"! {message.service or 'fault'}: {message}"
    return None


def _action(message: ActionBegan | ActionEnded | ActorFound | ActorLost, before: Scene) -> str | None:
    actor = message.actor
    match message:
        case ActorFound():
            return f"{actor} is here"
        case ActorLost():
            return f"{actor} has left"
        case ActionEnded(action="speak"):
            # An utterance is told once its last word is out; of people the words are not known.
            said = [u for u in before.said if u.open and u.actor == actor and u.text]
            return (
                f'{actor}: "{said[-1].text}" (from {wording.clock(said[-1].began - before.began)})' if said else None
            )
        case ActionBegan(action="speak") if actor == before.robot:
            return None
        case ActionBegan(action=action, targets=targets):
            return " ".join((actor, *filter(None, wording.deed(action, targets, before.robot))))
    return None
