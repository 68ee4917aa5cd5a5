"""Scene: one value with the actors, words, blocks with their sync points, and connection events of a running system.

`feed(scene, message, at)` gives the next scene; `services/console/terminal/render.py` draws one. Nothing here knows
the bus.
"""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.blocks import BlockProgress, Held, Hold, WarningFeedback
from engage_hri.schemas.body import WordSpoken
from engage_hri.schemas.body_faults import BodyFault, BodyFaults
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.fragments import Claim, HeadOwner, StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, Utterance
from engage_hri.schemas.recognition import ConnectionEvent, Floor, SamePeople, Statistics, WindowStatistics
from engage_hri.schemas.text import joined
from engage_hri.schemas.units import Seconds
from engage_hri.services.reports.in_force import InForce

UTTERANCES_KEPT = 160
EVENTS_KEPT = 100
NOTES_KEPT = 3
WARNINGS_KEPT = 64
LOST_KEPT = 3
"""Number of people that are shown as gone: those who left last."""
SAME_SPEECH: Seconds = 1.0
"""Greatest distance of the beginnings of a speech and of its words."""
OWN_BLOCKS = ("maintenance-", "response-")
"""Prefixes of the ids of the gaze arbiter's blocks; the view shows their effect, not their points."""


class Doing(Struct, frozen=True):
    """An action under way. targets: entity ids; empty with `look`: away. one_of: it is at one of them."""

    action: Action
    targets: tuple[str, ...]
    since: Seconds
    one_of: bool = False


class Actor(Struct, frozen=True, kw_only=True):
    """The robot or a person, with the actions under way."""

    id: str
    doing: tuple[Doing, ...] = ()
    present: bool = True

    @property
    def look(self) -> Doing | None:
        return next((doing for doing in self.doing if doing.action == "look"), None)


class UtteranceInView(Struct, frozen=True, kw_only=True):
    """Utterance of an actor. text: the words so far; of people as they are understood. id: of the `Utterance`."""

    actor: str
    began: Seconds
    behavior: str = ""
    id: str = ""
    text: str = ""
    open: bool = True


class EventInView(Struct, frozen=True, kw_only=True):
    """A connection event in its last known state."""

    event: ConnectionEvent
    began: Seconds


class HoldInView(Struct, frozen=True):
    """A hold in force. since, until: local instants of its beginning and of its end, unless it is let go before."""

    hold: Hold
    since: Seconds
    until: Seconds


Warned = tuple[str | None, str, str]
"""Block, kind and words of a warning."""


class Scene(Struct, frozen=True, kw_only=True):
    """State of everything that is shown. robot: its actor id. began: the instant that counts as zero."""

    robot: str
    began: Seconds
    now: Seconds
    actors: Mapping[str, Actor] = {}
    """By id, in the order in which they came."""
    said: tuple[UtteranceInView, ...] = ()
    events: tuple[EventInView, ...] = ()
    owner: Claim | None = None
    waiting: tuple[Claim, ...] = ()
    left: tuple[Claim, tuple[Claim, ...]] | None = None
    """Owner and claims of the head that generation told last, while it is not there: nobody rules the head then."""
    session: WindowStatistics | None = None
    notes: tuple[str, ...] = ()
    held: tuple[HoldInView, ...] = ()
    faults: tuple[BodyFault, ...] = ()
    study: InForce = InForce()
    """Condition of the study."""
    warned: tuple[Warned, ...] = ()
    """Warnings of behaviors of the last blocks: each again for another behavior is no news."""
    floor: Floor | None = None
    """Who speaks, and to whom; None: recognition has not told."""
    faults_by: str = ""
    """Participant that switched them; empty: the configuration."""

    @property
    def condition(self) -> StudyCondition | None:
        """Condition that is in force; None: generation has not told of one, or has gone."""
        return self.study.told

    def actor(self, id: str) -> Actor:
        return self.actors.get(id) or Actor(id=id)


def empty(robot: str, at: Seconds) -> Scene:
    return Scene(robot=robot, began=at, now=at)


def feed(scene: Scene, message: Message, at: Seconds) -> Scene:
    """Change the scene by a message. at: its local instant."""
    life = scene.study.life
    scene = replace(scene, now=max(scene.now, at), study=scene.study.after(message))
    match message:
        case ActionBegan() | ActionEnded() | ActorFound() | ActorLost():
            return _act(scene, message, at)
        case SamePeople(people=people):
            others = {each.actor for each in people}
            return replace(scene, actors={id: each for id, each in scene.actors.items() if id not in others})
        case WordSpoken():
            return _speak(scene, message, at)
        case Utterance(text=text) if text:
            return _understand(scene, message, at)
        case BlockProgress(block=block, progress="start"):
            return replace(scene, warned=tuple(each for each in scene.warned if each[0] != block))
        case PeerGone(participant="generation") if scene.owner is not None:
            return replace(scene, owner=None, waiting=(), left=(scene.owner, scene.waiting))
        case PeerAlive(participant="generation", run=run) if scene.left is not None:
            owner, waiting = scene.left if run == life else (None, ())
            return replace(scene, owner=owner, waiting=waiting, left=None)
        case ConnectionEvent():
            return _event(scene, message, at)
        case Floor():
            return replace(scene, floor=message)
        case HeadOwner(owner=owner, waiting=waiting):
            return replace(scene, owner=owner, waiting=waiting, left=None)
        case Held(holds=holds, at=told):
            since = [at + (each.since.seconds - told.seconds) for each in holds]
            lasts = [each.until.seconds - each.since.seconds for each in holds]
            held = zip(holds, since, lasts, strict=True)
            return replace(scene, held=tuple(HoldInView(hold, began, began + last) for hold, began, last in held))
        case BodyFaults(faults=faults, by=by):
            return replace(scene, faults=faults, faults_by=by)
        case Statistics(actor="", session=session):
            return replace(scene, session=session)
        case WarningFeedback() if is_again(scene, message):
            return scene
        case WarningFeedback(kind=kind, message=text):
            if message.behavior:
                scene = replace(scene, warned=(*scene.warned, _warned(message))[-WARNINGS_KEPT:])
            return _note(scene, f"{' '.join(filter(None, (kind, message.place)))}: {text}")
        case Fault():
            return _note(scene, f"{message.service or 'fault'}: {message}")
    return scene


def is_again(scene: Scene, warning: WarningFeedback) -> bool:
    """Tell whether another behavior of the same block has been warned of in the same words.

    Who leaves in the middle of a turn is missed by every behavior that was for this person.
    """
    return bool(warning.behavior) and _warned(warning) in scene.warned


def _warned(warning: WarningFeedback) -> Warned:
    return (warning.block, warning.kind, warning.message)


def _act(scene: Scene, message: ActionBegan | ActionEnded | ActorFound | ActorLost, at: Seconds) -> Scene:
    actor = scene.actor(message.actor)
    match message:
        case ActionBegan(action=action, targets=targets, one_of=one_of):
            # A new look ends the last one.
            others = tuple(
                d for d in actor.doing if d.action != action or (action != "look" and d.targets != targets)
            )
            actor = Actor(id=actor.id, doing=(*others, Doing(action, targets, at, one_of)))
        case ActionEnded(action=action, targets=targets):
            kept = [d for d in actor.doing if (d.action, d.targets) != (action, targets)]
            actor = Actor(id=actor.id, doing=tuple(kept))
        case ActorFound():
            actor = Actor(id=actor.id)
        case ActorLost():
            return replace(scene, actors=_without(scene.actors, actor.id))
    scene = replace(scene, actors={**scene.actors, actor.id: actor})
    if isinstance(message, ActionBegan | ActionEnded) and message.action == "speak":
        return _voice(scene, message, at)
    return scene


def _without(actors: Mapping[str, Actor], lost: str) -> dict[str, Actor]:
    """The actors with this one gone, at the end, and without those that have been gone for longest."""
    gone = [actor for actor in actors.values() if not actor.present and actor.id != lost][1 - LOST_KEPT :]
    here = [actor for actor in actors.values() if actor.present and actor.id != lost]
    return {each.id: each for each in (*here, *gone, Actor(id=lost, present=False))}


def _voice(scene: Scene, message: ActionBegan | ActionEnded, at: Seconds) -> Scene:
    if isinstance(message, ActionEnded):
        said = tuple(replace(u, open=False) if u.open and u.actor == message.actor else u for u in scene.said)
        return replace(scene, said=said)
    utterance = UtteranceInView(actor=message.actor, behavior=message.behavior, began=at)
    if any(u.open and (u.actor, u.behavior) == (message.actor, message.behavior) for u in scene.said):
        return scene
    return replace(scene, said=(*scene.said, utterance)[-UTTERANCES_KEPT:])


def _speak(scene: Scene, word: WordSpoken, at: Seconds) -> Scene:
    behavior = f"{word.block}:{word.behavior}"
    said = list(scene.said)
    for index in reversed(range(len(said))):
        if said[index].behavior == behavior and said[index].open:
            text = joined((said[index].text, word.word))
            said[index] = replace(said[index], text=text)
            break
    else:
        said.append(UtteranceInView(actor=scene.robot, behavior=behavior, began=at, text=word.word))
    return replace(scene, said=tuple(said)[-UTTERANCES_KEPT:])


def _understand(scene: Scene, utterance: Utterance, at: Seconds) -> Scene:
    """Put the words of a person where they were said."""
    began = at - max(0.0, utterance.at.seconds - utterance.began.seconds)
    new = UtteranceInView(actor=utterance.actor, began=began, id=utterance.id, text=utterance.text, open=False)
    said = list(scene.said)
    for index, known in reversed(list(enumerate(said))):
        is_speech = not known.id and not known.behavior and abs(known.began - began) <= SAME_SPEECH
        if known.actor == utterance.actor and (is_speech or known.id == utterance.id):
            said[index] = replace(known, id=utterance.id, text=utterance.text)
            return replace(scene, said=tuple(said))
    return replace(scene, said=(*scene.said, new)[-UTTERANCES_KEPT:])


def _event(scene: Scene, event: ConnectionEvent, at: Seconds) -> Scene:
    known = [other for other in scene.events if other.event.id == event.id]
    began = known[0].began if known else at
    if event.state in ("completed", "lost") and known and known[0].event.state != "started":
        # The shared phase is over; the view goes on to show the decision.
        event = replace(event, state=known[0].event.state, delay=known[0].event.delay)
    new = EventInView(event=event, began=began)
    if known:
        events = tuple(new if other.event.id == event.id else other for other in scene.events)
    else:
        events = (*scene.events, new)[-EVENTS_KEPT:]
    return replace(scene, events=events)


def _note(scene: Scene, text: str) -> Scene:
    return replace(scene, notes=(*scene.notes, text)[-NOTES_KEPT:])
