"""Behaviors: what a block or a turn fragment is made of, one struct per element of BML and its extension.

The dialects of BML (thesis draft, draft without namespace, BML 1.0) decode to these same structs. A sync
reference stays the string its author wrote (`speech-1:end+0.5`); `schemas/syncref.py` parses it.
"""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Probability, Seconds

Action = Literal["look", "point", "nod", "shake", "speak", "act"]
"""What an actor can be seen to do; `act` is the manipulation of an object."""
EventKind = Literal["directed_gaze", "mutual_facial_gaze", "adjacency_pair", "backchannel"]
Cause = Literal["turn", "reference", "response", "maintenance", "human"]
Hand = Literal["LEFT_HAND", "RIGHT_HAND", "BOTH_HANDS"]


class Timing(Struct, frozen=True, omit_defaults=True):
    """An inline sync point: `start="speech1:s1+0.5"` is `Timing("start", "speech1:s1+0.5")`."""

    sync: str
    ref: str


class Behavior(Struct, frozen=True, kw_only=True, tag_field="type", omit_defaults=True):
    """What every behavior has.

    id: unique in its block or fragment; sync references name it.
    required: without it, the block fails instead of going on.
    timing: sync references written at the behavior itself.
    line: of its XML source, from 1; 0 when there is none.
    """

    id: str
    required: bool = False
    timing: tuple[Timing, ...] = ()
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
    """Change the base gaze. Ends on arrival."""

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
    lexeme: str
    mode: Hand | None = None


class Head(Behavior, frozen=True, kw_only=True, tag="head", omit_defaults=True):
    """A nod or a shake, on top of whatever the head looks at."""

    lexeme: str
    repetition: int = 1
    amount: Probability = 0.5


class HeadDirectionShift(Behavior, frozen=True, kw_only=True, tag="headDirectionShift", omit_defaults=True):
    target: str


class Face(Behavior, frozen=True, kw_only=True, tag="face", omit_defaults=True):
    amount: Probability = 0.5
    overshoot: float = 0.0


class FaceLexeme(Behavior, frozen=True, kw_only=True, tag="faceLexeme", omit_defaults=True):
    lexeme: str
    amount: Probability = 0.5


class FaceFacs(Behavior, frozen=True, kw_only=True, tag="faceFacs", omit_defaults=True):
    au: int
    side: Literal["LEFT", "RIGHT", "BOTH"] = "BOTH"
    amount: Probability = 0.5


class FaceShift(Behavior, frozen=True, kw_only=True, tag="faceShift", omit_defaults=True):
    lexeme: str = ""
    au: int = 0
    side: Literal["LEFT", "RIGHT", "BOTH"] = "BOTH"
    amount: Probability = 0.5


class Posture(Behavior, frozen=True, kw_only=True, tag="posture", omit_defaults=True):
    stance: str = ""
    lexeme: str = ""
    part: str = ""


class PostureShift(Behavior, frozen=True, kw_only=True, tag="postureShift", omit_defaults=True):
    stance: str = ""
    lexeme: str = ""
    part: str = ""


class Pose(Behavior, frozen=True, kw_only=True, tag="pose", omit_defaults=True):
    lexeme: str = ""
    part: str = ""


class Locomotion(Behavior, frozen=True, kw_only=True, tag="locomotion", omit_defaults=True):
    target: str
    manner: str = ""


class Mark(Struct, frozen=True, omit_defaults=True):
    """A sync point inside an utterance: it is reached when the voice has said `position` characters of the text."""

    id: str
    position: int


class Speech(Behavior, frozen=True, kw_only=True, tag="speech", omit_defaults=True):
    """Say a text.

    text: the words, as they are to be heard.
    marks: sync points inside the text.
    markup: prosodic markup for the voice (the same words), passed through untouched.
    """

    text: str
    marks: tuple[Mark, ...] = ()
    markup: str = ""


class Wait(Behavior, frozen=True, kw_only=True, tag="wait", omit_defaults=True):
    duration: Seconds | None = None


class Emit(Behavior, frozen=True, kw_only=True, tag="emit", omit_defaults=True):
    """Send `event` to the feedback stream at its start."""

    event: str


class Event(Behavior, frozen=True, kw_only=True, tag="event", omit_defaults=True):
    """A robot-initiated connection event; recognition realizes it. Start = the request, end = its decision.

    anchors: sync references of the same block (`phrase-1:start`). The time limit runs from the latest of the
    event's start and these, so it is not armed before all of them were realised (or their block ended).
    An adjacency pair has no anchors: its clock runs from the `ended` signal of its `turn`.
    """

    kind: EventKind
    responder: str
    objects: tuple[str, ...] = ()
    cause: Cause = "turn"
    optional: bool = False
    accept: tuple[Action, ...] = ()
    """Adjacency pair: which actions answer it. Empty: recognition's default."""
    limit: Seconds | None = None
    anchors: tuple[str, ...] = ()
    turn: str = ""


class TurnSignal(Behavior, frozen=True, kw_only=True, tag="turn", omit_defaults=True):
    """Tells recognition what became of a turn; realized by recognition in no time.

    ended: the robot's turn `turn` is over (start = end of its last speech): adjacency-pair clocks run from here.
    answered / repaired: this fragment is the second / third turn of the human's pending pair.
    aborted: barge-in, fault, cancellation or silence closed the turn.
    """

    turn: str
    signal: Literal["ended", "answered", "repaired", "aborted"]
    actor: str = ""
    """The addressee."""


class Unknown(Behavior, frozen=True, kw_only=True, tag="unknown", omit_defaults=True):
    """What a block calls `element`, which nobody here knows: dropped with a warning, unless it is required."""

    element: str


class SpeechOption(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One phrase for a reference.

    text: the words. cost: how many words they are, or what the manager thinks they cost; >= 0.
    distractors: ids of objects besides the target that the phrase could mean, too.
    deictic: does it need a gesture to be understood, as `this` does?
    line: of its XML source, from 1; 0 when there is none.
    """

    text: str
    cost: float
    distractors: tuple[str, ...] = ()
    deictic: bool = False
    line: int = 0


class Reference(Behavior, frozen=True, kw_only=True, tag="reference", omit_defaults=True):
    """An object reference: generation replaces it by a phrase and perhaps a gaze, a directed gaze, a point.

    target: id of the object.
    minimum_reliability: in (0, 1), of the target being understood; None: generation's default.
    options: the phrases to choose from; None: generation proposes some, from what the world knows of the target.
    """

    target: str
    minimum_reliability: float | None = None
    options: tuple[SpeechOption, ...] | None = None


_Spelled = (
    Gaze | GazeShift | Pointing | Gesture | Head | HeadDirectionShift | Face | FaceLexeme | FaceFacs | FaceShift
    | Posture | PostureShift | Pose | Locomotion | Speech | Wait | Emit | Event | TurnSignal
)  # fmt: skip
BlockBehavior = _Spelled | Unknown
"""What a BML block may hold."""
FragmentBehavior = _Spelled | Reference
"""What a turn fragment may hold."""


class Synchronize(Struct, frozen=True, kw_only=True, tag="synchronize", omit_defaults=True):
    """All of `ref` (if any) and `syncs`, each with its offset, are one instant."""

    ref: str = ""
    syncs: tuple[str, ...] = ()
    line: int = 0


class Before(Struct, frozen=True, kw_only=True, tag="before", omit_defaults=True):
    """Every sync of `syncs` is no later than `ref`."""

    ref: str
    syncs: tuple[str, ...] = ()
    line: int = 0


class After(Struct, frozen=True, kw_only=True, tag="after", omit_defaults=True):
    """Every sync of `syncs` is no earlier than `ref`."""

    ref: str
    syncs: tuple[str, ...] = ()
    line: int = 0


class Constraint(Struct, frozen=True, kw_only=True, omit_defaults=True):
    operators: tuple[Synchronize | Before | After, ...]
    id: str = ""
    required: bool = False
    line: int = 0
