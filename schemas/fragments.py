"""Requests to generation, and its news: turn fragments and their outcomes, the owner of the head and what inhibits
its looks, and the conditions of a study, of which one person may meet several (thesis, chapter 5)."""

from typing import Annotated, ClassVar, Literal

from msgspec import Meta, Struct

from engage_hri.schemas.behaviors import Action, Constraint, FragmentBehavior, Reference, Speech
from engage_hri.schemas.blocks import SpokenText, Unread
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.recognition import ConnectionEvent, InterjectionReading
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.text import has_words
from engage_hri.schemas.units import Probability, Seconds, Stamp

TurnStatus = Literal["beginning", "middle", "end", "full", "backchannel"]
GestureChoice = Literal["none", "gaze", "directed_gaze", "directed_gaze_with_pointing"]


LONGEST_WITHIN: Seconds = 120.0
"""Longest time that a fragment may give for its answer."""


EVERYBODY = "*"
"""Stands for all people who are there; nobody can have it for an id."""


class TurnFragment(Struct, frozen=True, kw_only=True, tag="fragment", omit_defaults=True):
    """A turn or a part of one, to be spoken and acted. Thesis 3.2.

    id: the manager's name for it; no other live fragment has it.
    turn_index: first, second or third turn of an adjacency pair.
    turn_status: a whole turn (`full`), a piece of one (`beginning`, `middle`, `end`), or a `backchannel` while the
    person speaks.
    behaviors: speech and references are performed in the order in which they are written, others by their timing.
    constraints: between sync points of these behaviors.
    addressee: ids of those spoken to, one or several, or `*`: all people in the world; empty: the only one there. The
    robot looks from one to the next, and whoever answers first has answered for all.
    interruptible: who may interrupt it: ids, or `*`; True: those spoken to; False: nobody. None: as the `beginning`
    of its turn says, and else True. That of a `beginning` is for the pauses of its turn, too.
    interruptible_after: seconds for which somebody must have spoken into it to interrupt it. None: as the `beginning`
    of its turn says, and else 0.
    delay: hold the turn after this fragment while the manager thinks, with the eyes on `delay_target`.
    delay_target: id of an entity; empty: a surface, away from the face.
    accept: the actions that answer the adjacency pair of this turn; empty: recognition's default.
    within: seconds that its answer may take, from the end of the turn; None: recognition's default.
    line: of its XML source, from 1; 0 when there is none.
    """

    id: str
    turn_index: Literal[1, 2, 3] = 1
    turn_status: TurnStatus = "full"
    behaviors: tuple[FragmentBehavior, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    addressee: str | tuple[str, ...] = ""
    interruptible: bool | str | tuple[str, ...] | None = None
    interruptible_after: Seconds | None = None
    delay: bool = False
    delay_target: str = ""
    accept: tuple[Action, ...] = ()
    within: Seconds | None = None
    unread: tuple[Unread, ...] = ()
    """Parts of the document that were left out. The realizer warns of each when the block of the fragment begins."""
    from_parts: bool = False
    """True for a language model's tool call: each behavior is one part, and refusals name it
    (schemas/tool.py)."""
    line: int = 0

    @property
    def addressees(self) -> tuple[str, ...]:
        """All that `addressee` names, each once, in order."""
        return tuple(dict.fromkeys(filter(None, ids_in(self.addressee))))

    @property
    def worded(self) -> tuple[str, ...]:
        """Ids of its speeches and references that have words, in order."""
        spoken = [each for each in self.behaviors if isinstance(each, Reference | Speech)]
        return tuple(each.id for each in spoken if isinstance(each, Reference) or has_words(each.text))


def ids_in(named: str | tuple[str, ...]) -> tuple[str, ...]:
    """The ids of a field that takes one or several."""
    return (named,) if isinstance(named, str) else named


class PerformFragment(Request, frozen=True, kw_only=True, tag="perform_fragment", omit_defaults=True):
    """cmd: collaboration -> generation: perform a fragment. Terminal state: `FragmentOutcome`."""

    fragment: TurnFragment


class PairConsidered(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A gesture with a phrase, as one row of the table from which a reference was chosen.

    distractors: ids of the objects that the pair leaves possible besides the target.
    channel: reliability of the gesture alone. reliability: of the pair; minimum: the least allowed.
    cost: seconds that the pair takes. feasible: it can be performed and is reliable enough. reason: why, in words.
    """

    gesture: GestureChoice
    phrase: str
    distractors: tuple[str, ...]
    channel: float
    reliability: float
    minimum: float
    cost: Seconds
    feasible: bool
    chosen: bool = False
    reason: str = ""


class ReferenceChoice(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The gesture and the phrase chosen for a reference. Thesis 3.3.2.

    If no pair can be performed, none is chosen, and the fragment fails.

    reference: id of the behavior. target: id of the object.
    cost: seconds that the pair takes.
    pairs: all that were considered.
    """

    reference: str
    target: str
    gesture: GestureChoice
    phrase: str
    reliability: Probability
    cost: Seconds
    pairs: tuple[PairConsidered, ...] = ()


class ReferenceMade(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A reference as it really was made, whatever was chosen: from the sync points and the words that came.

    reference: id of the behavior. object: id of the object.
    by: `pointing` if the stroke of a point came, else `look` if a gaze came to the object, else `words` if words of
    the phrase were said, else `nothing`.
    phrase: the words of it that were said.
    looked: the person looked there, of several all of them; None: nothing was shown, or the robot did not wait for
    that, or it is undecided.
    delay: seconds until the person did, of several the last of them.
    """

    reference: str
    object: str
    by: Literal["pointing", "look", "words", "nothing"]
    phrase: str = ""
    looked: bool | None = None
    delay: Seconds | None = None


class HeardText(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Words of a person, as they were understood for good.

    actor: who said them. id: of the `Utterance`. began: when they began to say it. to: ids of those to whom it was
    said, if that is known.
    """

    actor: str
    id: str
    text: str
    began: Stamp
    to: tuple[str, ...] = ()


class Interjected(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Speech of a person into a turn of the robot, and what came of it.

    actor: the person. since: when the speech began. words: as far as they were known.
    reading: what it is, as in `Interjection`; `open`: nobody has decided that.
    held: seconds for which the robot has waited for the decision. went_on: the turn has gone on after it.
    """

    actor: str
    since: Stamp
    reading: InterjectionReading
    words: str = ""
    held: Seconds = 0.0
    went_on: bool = False


class FragmentOutcome(Outcome, frozen=True, kw_only=True, tag="fragment_outcome", omit_defaults=True):
    """evt: generation -> requester: the end of a fragment: its block has ended and its gazes are decided.

    fragment: its id. status: `interrupted`: it was ended by another, or on request; `unknown`: what performed it is
    gone, and nobody knows what became of the rest; `refused`: nothing was said or done (only clients tell that, of a
    fragment within a stream).
    spoken: the words that were really said, as far as is known.
    replaced_by: the block whose `REPLACE` ended it, if it was interrupted for that reason.
    choices: what was chosen for each reference, the last time. warnings: what was done otherwise than asked.
    fault: why it failed, or why nothing more is known.
    """

    fragment: str
    status: Literal["done", "failed", "interrupted", "unknown", "refused"]
    spoken: tuple[SpokenText, ...] = ()
    unsaid: tuple[str, ...] = ()
    """Ids of the speeches and references of which no word was said, though they have words, in order."""
    references: tuple[ReferenceMade, ...] = ()
    """How each reference really was made, in order."""
    eye_contact: bool | None = None
    """The person returned the robot's look at the end of the turn; None: it did not come, or nobody has decided."""
    replaced_by: str = ""
    events: tuple[ConnectionEvent, ...] = ()
    """Each connection event of the turn in its last known state, by start."""
    heard: tuple[HeardText, ...] = ()
    """What people have said since the turn before was over, by start."""
    interjections: tuple[Interjected, ...] = ()
    """What people have said into the turn, by start, and what came of it."""
    choices: tuple[ReferenceChoice, ...] = ()
    warnings: tuple[str, ...] = ()
    fault: Fault | None = None


class TurnClosed(Struct, frozen=True, kw_only=True, tag="turn_closed", omit_defaults=True):
    """evt: generation: a turn of the robot is over: its fragments have ended and its adjacency pair is decided.

    turn: id of the fragment that opened it. addressee: id of the person; of several that of the one named first.
    others: ids of the others.
    status: `aborted`: a barge-in, fault, cancellation or silence ended it; `reason` says which.
    fragments: their ids, in order.
    """

    turn: str
    addressee: str
    status: Literal["done", "aborted"]
    others: tuple[str, ...] = ()
    reason: str = ""
    fragments: tuple[str, ...] = ()
    spoken: tuple[SpokenText, ...] = ()
    """The words said in all its fragments, in order; speeches are named `fragment:behavior`."""
    events: tuple[ConnectionEvent, ...] = ()
    """Each connection event of the turn in its last known state, by start."""
    heard: tuple[HeardText, ...] = ()
    """What people have said since the turn before was over, its answer among it, by start."""
    interjections: tuple[Interjected, ...] = ()
    """What people have said into the turn, by start, and what came of it."""


class Claim(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A wish for the robot's gaze, by which the arbiter decides about the head.

    kind: `inhibition`, `fragment`, `glance`, `aversion`, `response`, `hands`, `face`, that of an installed package's
    policy, or `none`.
    priority: 1 (the strongest) to the number of kinds that the robot follows; 0 with kind `none`.
    target: entity id; empty: hold the direction.
    reason: why, in words, for people.
    """

    kind: str
    priority: int
    target: str = ""
    reason: str = ""


class HeadOwner(Struct, frozen=True, kw_only=True, tag="head_owner", omit_defaults=True):
    """state: generation. The claim that owns the head, and the claims that wait.

    Published at every change of the owner, of its target or reason, or of the waiting claims; a late subscriber gets
    the last one.

    since: when this owner got the head.
    waiting: the strongest first.
    """

    owner: Claim
    since: Stamp
    waiting: tuple[Claim, ...] = ()


class Inhibit(Request, frozen=True, kw_only=True, tag="inhibit", omit_defaults=True):
    """cmd: anyone -> generation: a lease that inhibits gaze or pointing. Ends in `InhibitionEnded`.

    A gaze or a pointing of the running fragment is aborted, those of later fragments are left out. The newest lease
    on a part counts. It ends when `ttl` has passed without a `KeepAlive` or being sent again, and with its owner's
    life.

    part: what is inhibited: the gaze, or pointing with one arm.
    mode: of the gaze: `release` lets the head go back to the base gaze, `hold` keeps the direction, `target` looks at
    `target`. Without meaning for an arm.
    ttl: how long the lease lasts without renewal.
    target: entity id, with mode `target`.
    """

    is_updatable: ClassVar[bool] = True

    part: Literal["gaze", "point-left", "point-right"] = "gaze"
    mode: Literal["release", "hold", "target"] = "hold"
    ttl: Seconds = 5.0
    target: str = ""

    @property
    def term(self) -> Seconds:
        return self.ttl


class InhibitionEnded(Outcome, frozen=True, kw_only=True, tag="inhibition_ended", omit_defaults=True):
    """evt: generation -> requester: the lease has ended.

    reason: `lapsed`: not renewed; `released`: cancelled; `owner_lost`: its owner has gone from the bus.
    """

    reason: Literal["lapsed", "released", "owner_lost"] = "lapsed"


LONGEST_NAME = 80
"""Characters of a condition's name, and of the name of who set it."""
ConditionName = Annotated[str, Meta(max_length=LONGEST_NAME)]


class SetCondition(Request, frozen=True, kw_only=True, tag="set_condition", omit_defaults=True):
    """cmd: operator or wizard -> generation: this condition begins now. Ends in `ConditionSet`.

    name: any name, by which `engage analyse` tells the conditions apart; empty: what comes belongs to none.
    speech_only: the robot says the words of the task and does nothing else, its head to the upper right, as in the
        condition `degraded-generation`. What is under way of looks and points is broken off, as by an inhibition.
    by: who sets it, for the record; empty: the requester.
    """

    name: ConditionName = ""
    speech_only: bool = False
    by: ConditionName = ""


class ConditionSet(Outcome, frozen=True, kw_only=True, tag="condition_set", omit_defaults=True):
    """evt: terminal state of `SetCondition`: this is in force."""

    name: str = ""
    speech_only: bool = False


class StudyCondition(Struct, frozen=True, kw_only=True, tag="study_condition", omit_defaults=True):
    """state: generation. The condition in force.

    Published at the start, with what the configuration says of `speech_only`, and whenever one is set; a late
    subscriber gets the last one.

    at: when it began. name: empty: none has been set. by: who set it; empty: the configuration.
    """

    at: Stamp
    name: str = ""
    speech_only: bool = False
    by: str = ""

    @property
    def is_told(self) -> bool:
        """True if people are to hear of it: somebody set it, or the configuration leaves the robot words alone."""
        return bool(self.by) or self.speech_only

    @property
    def sentence(self) -> str:
        """Words for people: which it is, and who set it."""
        by = f", set by {self.by}" if self.by else ""
        return f"condition of the study: {condition_words(self.name, self.speech_only)}{by}"

    @property
    def lost_sentence(self) -> str:
        """Words for people when it went with its generation, and is in force no more."""
        was = f"{condition_words(self.name, self.speech_only)!r}, set by {self.by}"
        return f"condition of the study: none, for generation has gone, and with it {was}: begin it again"


def condition_words(name: str, speech_only: bool) -> str:
    """A condition in words, for people."""
    return f"{name or 'none'}{', speech only' if speech_only else ''}"
