"""Lines of the log, one for each message that matters: for a file, a pipe, or a screen reader."""

from collections.abc import Iterator

from msgspec import Struct

from engage_hri.schemas.behaviors import EVENT_KINDS
from engage_hri.schemas.blocks import BlockProgress, BodyHeld, Held, SyncPointProgress, WarningFeedback
from engage_hri.schemas.body_faults import BodyFaults, words
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import HeadOwner, StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, Interjection, Statistics
from engage_hri.schemas.units import Seconds
from engage_hri.services.console import wording
from engage_hri.services.console.view import OWN_BLOCKS, Scene, is_again

NOTICED: Seconds = 0.1
"""Time for which something is held that is told with it."""


class Telling(Struct, frozen=True, kw_only=True):
    """Choice of the messages in the log.

    actions: of people and the robot. points: sync points. head: owner of the head. warnings: of the realizer and of
    the policies.
    """

    actions: bool = True
    points: bool = True
    head: bool = True
    statistics: bool = False
    warnings: bool = True


def line(message: Message, before: Scene, after: Scene, at: Seconds, telling: Telling) -> str | None:
    """Write the line for one message; None for most. before, after: the scene around it. at: its local instant."""
    text = _text(message, before, after, at, telling)
    return None if text is None else timed(text, after, at)


def timed(text: str, scene: Scene, at: Seconds) -> str:
    """Write the line for a text, with the time since the scene began."""
    return f"{wording.clock(at - scene.began):>8}  {text}"


def _text(message: Message, before: Scene, after: Scene, at: Seconds, telling: Telling) -> str | None:
    match message:
        case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
            return _action(message, before) if telling.actions else None
        case Utterance(final=True, text=text) if telling.actions and text:
            return f'{wording.addressed(message, before.floor, before.robot)}: "{text}"'
        case SyncPointProgress(block=block) if telling.points and not block.startswith(OWN_BLOCKS):
            planned = "" if message.predicted is None else f" (planned {wording.seconds(message.predicted)})"
            return f"{block}:{message.behavior}:{message.sync} at {wording.seconds(message.time)}{planned}"
        case ConnectionEvent(state=state) if state != "completed" and not message.retold:
            objects = message.objects
            about = f" about {wording.together(objects, one_of=message.one_of)}" if objects else ""
            kind, decided = EVENT_KINDS[message.kind].title, wording.decision(message)
            return f"* {kind}, {message.initiator} → {message.responder}{about} ({message.cause}): {decided}"
        case Interjection():
            return wording.interjection(message)
        case Floor():
            return wording.floor(message, before.robot) or None
        case Statistics() if telling.statistics:
            return wording.statistics(message)
        case HeadOwner() if telling.head:
            waiting = ", ".join(claim.kind for claim in message.waiting)
            return f"head: {wording.claim(message.owner)}" + (f"; waiting: {waiting}" if waiting else "")
        case Held():
            return "; ".join(holds(before, after, at)) or None
        case BodyHeld(holds=waiting, reasons=reasons) if waiting:
            named = ", ".join(wording.held(each) for each in waiting)
            return f"! the body holds {named}: {'; '.join(reasons) or 'nobody renews it'}"
        case BodyFaults(faults=faults) if faults:
            return f"! faults of the body that are switched on: {', '.join(map(words, faults))}"
        case BodyFaults() if before.faults:
            return "no fault of the body is switched on any more"
        case StudyCondition() if message.is_told or before.condition:
            return message.sentence
        case PeerGone(participant="generation") if (
            lost := after.study.missed
        ) is not None and before.condition is lost:
            return f"! {lost.lost_sentence}"
        case BlockProgress(progress="end", block=str() as block) if not block.startswith(OWN_BLOCKS):
            return f"block {block}: {message.status}"
        case WarningFeedback() if telling.warnings:
            return None if is_again(before, message) else wording.warning(message)
        case Fault():
            return f"! {message.service or 'fault'}: {message}"
    return None


def holds(before: Scene, after: Scene, at: Seconds) -> Iterator[str]:
    """Words for each hold that has begun since the scene before, and for each that is no more."""
    at = max(at, after.began)  # It may have been told before anybody listened.
    known, left = ([each.hold for each in scene.held] for scene in (before, after))
    for each in after.held:
        if each.hold not in known:
            already = f"for {wording.seconds(at - each.since)} already and " if at - each.since > NOTICED else ""
            yield f"held: {wording.held(each.hold)}, {already}for at most {wording.seconds(each.until - at)}"
    for each in before.held:
        if each.hold in left:
            continue
        if wholes := [wording.held(hold) for hold in left if hold.holds(each.hold)]:
            verb = "is" if len(wholes) == 1 else "are"
            yield f"still held: {wording.held(each.hold)}, because {' and '.join(wholes)} {verb}"
        else:
            yield f"no longer held: {wording.held(each.hold)}, after {wording.seconds(at - each.since)}"


def _action(message: ActionBegan | ActionEnded | ActorFound | ActorLost, before: Scene) -> str | None:
    actor = message.actor
    match message:
        case ActorFound():
            return f"{actor} is here"
        case ActorLost():
            return f"{actor} has left"
        case ActionEnded(action="speak"):
            # An utterance of the robot is told once its last word is out; those of people when they are understood.
            for said in reversed(before.said):
                if said.open and said.actor == actor and said.text and said.behavior:
                    return f'{actor}: "{said.text}" (from {wording.clock(said.began - before.began)})'
        case ActionBegan(action="speak") if actor == before.robot:
            return None
        case ActionBegan(action=action, targets=targets, one_of=one_of):
            words = wording.action_words(action, targets, before.robot, one_of=one_of)
            return " ".join((actor, *filter(None, words)))
    return None
