"""Behaviors, of which blocks and turn fragments are made: one struct for each element of BML and its extension.

The dialects of BML (thesis draft, draft without namespace, BML 1.0) decode to these same structs. A sync
reference stays the string its author wrote (`speech-1:end+0.5`); `schemas/references.py` parses it.
"""

from collections.abc import Mapping
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Probability, Seconds

Action = Literal["look", "point", "nod", "shake", "speak", "act"]
"""Kinds of actions that an actor can be seen to do; `act` is the manipulation of an object."""
EventKind = Literal["directed_gaze", "mutual_facial_gaze", "adjacency_pair", "backchannel"]


class KindOfEvent(Struct, frozen=True, kw_only=True):
    """A kind of connection event, for all who list, count or show them.

    title: as people write it. short: the same where there is little room, if it differs. prefix: of the ids.
    delay: mean seconds until it is decided, by Table 2.1. Whoever plans with it knows no better.
    is_answered: the other has to respond; else the sign of the other is the event, and can be neither late nor fail.
    needs_objects: the robot cannot begin it without an object.
    """

    title: str
    short: str = ""
    prefix: str
    delay: Seconds
    is_answered: bool = True
    needs_objects: bool = False


EVENT_KINDS: Mapping[EventKind, KindOfEvent] = {
    "directed_gaze": KindOfEvent(title="directed gaze", prefix="dg", delay=0.3, needs_objects=True),
    "mutual_facial_gaze": KindOfEvent(title="mutual facial gaze", short="mutual gaze", prefix="mfg", delay=0.7),
    "adjacency_pair": KindOfEvent(title="adjacency pair", prefix="ap", delay=0.4),
    "backchannel": KindOfEvent(title="backchannel", prefix="bc", delay=0.0, is_answered=False),
}
"""Kinds of connection events, in the order of all tables. `services/recognition/events` has a module for each."""
ACTIONS: Mapping[Action, tuple[str, str]] = {
    "look": ("looks", "at "),
    "point": ("points", "at "),
    "nod": ("nods", "to "),
    "shake": ("shakes the head", "to "),
    "speak": ("speaks", "to "),
    "act": ("moves", ""),
}
"""Words for each action of somebody, and those that come before its targets."""
Cause = Literal["turn", "reference", "response", "maintenance", "human"]
Hand = Literal["LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS"]
Side = Literal["LEFT", "RIGHT", "BOTH"]


class Timing(Struct, frozen=True, omit_defaults=True):
    """An inline sync point: `start="speech1:s1+0.5"` is `Timing("start", "speech1:s1+0.5")`."""

    sync: str
    ref: str


class Behavior(Struct, frozen=True, kw_only=True, tag_field="type", omit_defaults=True):
    """Fields that every behavior has.

    id: unique in its block or fragment; sync references name it.
    required: if it cannot be performed, the whole block fails instead of going on without it.
    timing: sync references written at the behavior itself.
    needs: ids of behaviors of the same block without which this one means nothing: once one of these is dropped,
    interrupted or refused by the body, this one is dropped, too. One that has begun is finished all the same;
    a connection event is withdrawn even then, as long as it is undecided.
    line: of its XML source, from 1; 0 when there is none.
    """

    id: str
    required: bool = False
    timing: tuple[Timing, ...] = ()
    needs: tuple[str, ...] = ()
    line: int = 0


class Gaze(Behavior, frozen=True, kw_only=True, tag="gaze", omit_defaults=True):
    """Look at a target, overlaid on the base gaze; at its end the eyes go back to the base.

    target: id of an entity; an actor's id stands for its face.
    influence: which parts may move, as BML names them; empty: the body chooses.
    offset_angle: degrees away from the target. offset_direction: which way, `LEFT`, `UPRIGHT` and so on.
    """

    target: str
    influence: str = ""
    offset_angle: Degrees = 0.0
    offset_direction: str = ""


class GazeShift(Behavior, frozen=True, kw_only=True, tag="gazeShift", omit_defaults=True):
    """Change the base gaze, to which the eyes return after each gaze. Ends on arrival.

    target, influence, offset_angle, offset_direction: as in `Gaze`.
    """

    target: str
    influence: str = ""
    offset_angle: Degrees = 0.0
    offset_direction: str = ""


class Pointing(Behavior, frozen=True, kw_only=True, tag="pointing", omit_defaults=True):
    """Point at a target with an arm.

    target: id of an entity. mode: which hand; None: the body chooses.
    """

    target: str
    mode: Hand | None = None


class Gesture(Behavior, frozen=True, kw_only=True, tag="gesture", omit_defaults=True):
    """Make a gesture that the body knows by name.

    lexeme: the name. mode: which hand; None: the body chooses.
    """

    lexeme: str
    mode: Hand | None = None


class Head(Behavior, frozen=True, kw_only=True, tag="head", omit_defaults=True):
    """Nod, shake, tilt or turn the head on top of the gaze, to which it comes back.

    lexeme: `NOD`, `SHAKE`, `TILT`, `UP` and so on. repetition: how many times. amount: how large, of the largest.
    """

    lexeme: str
    repetition: int = 1
    amount: Probability = 0.5


class HeadDirectionShift(Behavior, frozen=True, kw_only=True, tag="headDirectionShift", omit_defaults=True):
    """Turn the base direction of the head to a target. Ends on arrival."""

    target: str


class Expression(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One expression of a face that has several: a lexeme, or an action unit. amount: None: that of the face."""

    lexeme: str = ""
    au: int = 0
    side: Side = "BOTH"
    amount: Probability | None = None


class Face(Behavior, frozen=True, kw_only=True, tag="face", omit_defaults=True):
    """Show several expressions of the face as one, until it relaxes. One alone is a `FaceLexeme` or a `FaceFacs`.

    overshoot: how much farther the face goes at the peak of its attack, as a share.
    """

    amount: Probability = 0.5
    overshoot: float = 0.0
    expressions: tuple[Expression, ...] = ()


class FaceLexeme(Behavior, frozen=True, kw_only=True, tag="faceLexeme", omit_defaults=True):
    """Show an expression of the face that has a name, until it relaxes."""

    lexeme: str
    amount: Probability = 0.5


class FaceFacs(Behavior, frozen=True, kw_only=True, tag="faceFacs", omit_defaults=True):
    """Move one action unit of the face (Facial Action Coding System), until it relaxes. au: its number."""

    au: int
    side: Side = "BOTH"
    amount: Probability = 0.5


class FaceShift(Behavior, frozen=True, kw_only=True, tag="faceShift", omit_defaults=True):
    """Change the expression to which the face returns, by name or by action unit. Ends on arrival.

    expressions: if there are several; `lexeme` and `au` are empty then.
    """

    lexeme: str = ""
    au: int = 0
    side: Side = "BOTH"
    amount: Probability = 0.5
    expressions: tuple[Expression, ...] = ()


class PartPose(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One pose of a posture that has several. lexeme: its name. part: its part of the body."""

    lexeme: str = ""
    part: str = ""


class Posture(Behavior, frozen=True, kw_only=True, tag="posture", omit_defaults=True):
    """Take a posture until it relaxes.

    stance: of the whole body. lexeme: a pose by name. part: its part of the body.
    poses: if there are several; `lexeme` and `part` are empty then.
    """

    stance: str = ""
    lexeme: str = ""
    part: str = ""
    poses: tuple[PartPose, ...] = ()


class PostureShift(Behavior, frozen=True, kw_only=True, tag="postureShift", omit_defaults=True):
    """Change the posture to which the body returns. Ends on arrival. stance, lexeme, part, poses: as in `Posture`."""

    stance: str = ""
    lexeme: str = ""
    part: str = ""
    poses: tuple[PartPose, ...] = ()


class Pose(Behavior, frozen=True, kw_only=True, tag="pose", omit_defaults=True):
    """Take a pose that has a name, with one part of the body."""

    lexeme: str = ""
    part: str = ""


def posed(behavior: Posture | PostureShift | Pose) -> tuple[PartPose, ...]:
    """List the poses of a posture, be they one or several."""
    further = () if isinstance(behavior, Pose) else behavior.poses
    is_given = behavior.lexeme or behavior.part or not further
    return (*([PartPose(lexeme=behavior.lexeme, part=behavior.part)] if is_given else ()), *further)


def expressed(behavior: Face | FaceLexeme | FaceFacs | FaceShift) -> tuple[Expression, ...]:
    """List the expressions of a face, be they one or several."""
    match behavior:
        case FaceLexeme(lexeme=lexeme):
            return (Expression(lexeme=lexeme),)
        case FaceFacs(au=au, side=side):
            return (Expression(au=au, side=side),)
        case FaceShift(lexeme=lexeme, au=au, side=side) if lexeme or au:
            return (Expression(lexeme=lexeme, au=au, side=side), *behavior.expressions)
    return behavior.expressions


def is_empty(behavior: Behavior) -> bool:
    """True for a posture or a shift of the face that names nothing to show. (A face that does may keep a time.)"""
    match behavior:
        case FaceShift():
            return not any(each.lexeme or each.au for each in expressed(behavior))
        case Posture() | PostureShift():
            return not behavior.stance and not any(each.lexeme for each in posed(behavior))
        case Pose(lexeme=lexeme):
            return not lexeme
    return False


class Locomotion(Behavior, frozen=True, kw_only=True, tag="locomotion", omit_defaults=True):
    """Move to a target. manner: how, for example `walk`."""

    target: str
    manner: str = ""


class Mark(Struct, frozen=True, omit_defaults=True):
    """A sync point inside an utterance: it is reached when the voice has said `position` characters of the text."""

    id: str
    position: int


LONGEST_SPEECH = 5000
"""Characters of one speech, some five minutes; one with more is refused."""


class Speech(Behavior, frozen=True, kw_only=True, tag="speech", omit_defaults=True):
    """Say a text.

    text: the words, as they are to be heard.
    marks: sync points inside the text.
    markup: prosodic markup for the voice (the same words): SSML without its outer `speak`.
    language: of the words, a tag such as `de` or `pt-BR`; empty: that of the voice.
    """

    text: str
    marks: tuple[Mark, ...] = ()
    markup: str = ""
    language: str = ""


class Wait(Behavior, frozen=True, kw_only=True, tag="wait", omit_defaults=True):
    """Let time pass. duration: None: until a constraint to its `end` is met."""

    duration: Seconds | None = None


class Emit(Behavior, frozen=True, kw_only=True, tag="emit", omit_defaults=True):
    """Send `event` to the feedback stream at its start."""

    event: str


class Event(Behavior, frozen=True, kw_only=True, tag="event", omit_defaults=True):
    """A connection event that the robot begins; recognition performs it. Start: its request; end: its decision.

    `needs` names the behaviors that it is about. It begins no earlier than the first of these really does.
    responder: actor id of the person.
    objects: ids of what it is about.
    cause: what the robot begins it for. optional: its failure does not count.
    limit: time within which the person has to respond; None: recognition's default.
    anchors: sync references of the same block (`phrase-1:start`). A gaze event starts when all of them are realised
    or their block has ended, or before that when the robot looks or points there. Its limit runs from the latest of
    its start and these. An adjacency pair has none: its limit runs from the `ended` signal of its turn.
    turn: of an adjacency pair, the turn that opens it.
    """

    kind: EventKind
    responder: str
    objects: tuple[str, ...] = ()
    cause: Cause = "turn"
    optional: bool = False
    accept: tuple[Action, ...] = ()
    """Adjacency pair: the actions that answer it. Empty: recognition's default."""
    limit: Seconds | None = None
    anchors: tuple[str, ...] = ()
    turn: str = ""


class TurnSignal(Behavior, frozen=True, kw_only=True, tag="turn", omit_defaults=True):
    """Tell recognition what became of a turn. Takes no time.

    signal: `ended`: the robot's turn is over with its last speech, and the limits of adjacency pairs run from now;
    `answered`, `repaired`: this fragment is the second or third turn of the pair that the person opened;
    `aborted`: a barge-in, fault, cancellation or silence closed the turn.
    """

    turn: str
    signal: Literal["ended", "answered", "repaired", "aborted"]
    actor: str = ""
    """The addressee; empty: all to whom the turn is."""


class Unknown(Behavior, frozen=True, kw_only=True, tag="unknown", omit_defaults=True):
    """A behavior of a type that is not known here: dropped with a warning; if it is required, the block fails.

    element: name of its element, with the prefix that it has there. namespace: empty, unless it is not BML's.
    lacks: of an element that is known, the attribute without which there is nothing to perform.
    """

    element: str
    namespace: str = ""
    lacks: str = ""


class SpeechOption(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One phrase for a reference.

    text: the words. cost: number of words, or another measure that the manager chooses; >= 0.
    distractors: ids of the other objects that the phrase could mean as well.
    deictic: true if it needs a gesture to be understood, as `this` does.
    line: of its XML source, from 1; 0 when there is none.
    """

    text: str
    cost: float
    distractors: tuple[str, ...] = ()
    deictic: bool = False
    line: int = 0


class Reference(Behavior, frozen=True, kw_only=True, tag="reference", omit_defaults=True):
    """An object reference. Generation replaces it by a phrase, perhaps with a gaze, a directed gaze or pointing.

    target: id of the object; of several that are shown at once, their ids with ` + ` between.
    minimum_reliability: least probability, in (0, 1), that the target is understood; None: generation's default.
    options: the phrases to choose from; None: generation proposes some, from what the world knows of the target.
    """

    target: str
    minimum_reliability: float | None = None
    options: tuple[SpeechOption, ...] | None = None


_Spelled = (
    Gaze | GazeShift | Pointing | Gesture | Head | HeadDirectionShift | Face | FaceLexeme | FaceFacs | FaceShift
    | Posture | PostureShift | Pose | Locomotion | Speech | Wait | Emit | Event | TurnSignal
)  # fmt: skip
Looks = Gaze | GazeShift | HeadDirectionShift
"""Behaviors that move the head to look at something."""
BlockBehavior = _Spelled | Unknown
"""Behaviors that a BML block may hold."""
FragmentBehavior = _Spelled | Reference
"""Behaviors that a turn fragment may hold."""


class Synchronize(Struct, frozen=True, kw_only=True, tag="synchronize", omit_defaults=True):
    """Operator: `ref` (if given) and all of `syncs`, each with its offset, are the same instant."""

    ref: str = ""
    syncs: tuple[str, ...] = ()
    line: int = 0


class Before(Struct, frozen=True, kw_only=True, tag="before", omit_defaults=True):
    """Operator: each of `syncs` comes before `ref` or with it."""

    ref: str
    syncs: tuple[str, ...] = ()
    line: int = 0


class After(Struct, frozen=True, kw_only=True, tag="after", omit_defaults=True):
    """Operator: each of `syncs` comes after `ref` or with it."""

    ref: str
    syncs: tuple[str, ...] = ()
    line: int = 0


class Constraint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Conditions between sync points, all of which must hold.

    required: if they cannot be met, the whole block fails instead of going on without them.
    """

    operators: tuple[Synchronize | Before | After, ...]
    id: str = ""
    required: bool = False
    line: int = 0
