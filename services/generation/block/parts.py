"""Behaviors that replace a reference, and their timing: `check-back`, of Appendix B, or `figure-3.3`."""

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    After,
    BlockBehavior,
    Event,
    Gaze,
    Hand,
    Pointing,
    Reference,
    Speech,
    Synchronize,
    Timing,
)
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.schemas.references import SyncRef
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import each_of
from engage_hri.services.generation.block.rewriting import Operator, Point, Replacement
from engage_hri.services.generation.turns.plan import TurnPlan

LEAST_SEEN: Seconds = 0.3
"""Time for which the robot looks at least at what it refers to: below it nobody sees that it does."""


class Made(Struct, frozen=True):
    """Ids of the behaviors that a block has for one reference; "": it has none.

    events: one for each who is to look there. words: of its phrase, as chosen. falls: the phrase falls with a gesture
    (see `Parts`).
    """

    reference: str
    object: str
    gaze: str = ""
    point: str = ""
    phrase: str = ""
    events: tuple[str, ...] = ()
    words: str = ""
    falls: bool = False

    @property
    def gestures(self) -> tuple[str, ...]:
        return tuple(filter(None, (self.gaze, self.point)))

    @property
    def by(self) -> Point:
        """The sync point from which on the object has been referred to: the end of its phrase, or of its gesture."""
        if self.phrase:
            return self.phrase, "end"
        return (self.point, "stroke_end") if self.point else (self.gaze, "stroke")


class FreshIds:
    """Maker of ids that the fragment does not use."""

    def __init__(self, fragment: TurnFragment) -> None:
        self._taken = {behavior.id for behavior in fragment.behaviors}

    def fresh(self, wish: str) -> str:
        """Take `wish` as an id, or the first of `wish-2`, `wish-3`... that is free."""
        name, count = wish, 2
        while name in self._taken:
            name, count = f"{wish}-{count}", count + 1
        self._taken.add(name)
        return name


class Parts:
    """The behaviors that replace one reference. closing: punctuation at the end of its phrase.

    needs: what they need, each of them. The phrase needs the gestures with which it was chosen: it is never said
    without them, and what follows needs the phrase, so that the reference can be chosen again in the place of both.
    """

    def __init__(
        self,
        reference: Reference,
        choice: ReferenceChoice,
        closing: str,
        names: FreshIds,
        turn: TurnPlan,
        hand: Hand | None,
        needs: tuple[str, ...] = (),
    ):
        points = choice.gesture == "directed_gaze_with_pointing"
        looks = choice.gesture != "none"
        required, line = reference.required, reference.line
        given = () if required else needs
        self.reference = reference
        self.gaze = self.point = self.phrase = self.glance = ""
        self.events: tuple[str, ...] = ()
        self.behaviors: list[BlockBehavior] = []
        anchors: list[str] = []
        if looks:
            self.gaze = names.fresh(f"{reference.id}-gaze")
            self.behaviors.append(
                Gaze(id=self.gaze, target=reference.target, required=required, needs=given, line=line)
            )
            anchors.append(f"{self.gaze}:stroke")
        if points:
            self.point = names.fresh(f"{reference.id}-point")
            self.behaviors.append(
                Pointing(id=self.point, target=reference.target, mode=hand, required=required, needs=given, line=line)
            )
            anchors.append(f"{self.point}:stroke")
        if choice.phrase:
            self.phrase = names.fresh(f"{reference.id}-phrase")
            said = choice.phrase + closing
            gestures = tuple(filter(None, (self.gaze, self.point)))
            phrase_needs = given if required else gestures or given
            self.behaviors.append(Speech(id=self.phrase, text=said, required=required, needs=phrase_needs, line=line))
            anchors.append(f"{self.phrase}:start")
        if looks and choice.gesture != "gaze":
            made = Event(
                id="",
                kind="directed_gaze",
                responder="",
                objects=each_of(reference.target),
                cause="reference",
                anchors=tuple(anchors),
                turn=turn.turn,
                timing=(Timing("start", f"{self.gaze}:start"),),
                needs=tuple(filter(None, (self.gaze, self.point))),
            )
            asked = {names.fresh(f"{reference.id}-event"): each for each in turn.addressees}
            self.behaviors += [replace(made, id=id, responder=each) for id, each in asked.items()]
            self.events = tuple(asked)

        falls = bool(self.phrase and looks and not required)
        self.made = Made(
            reference.id, reference.target, self.gaze, self.point, self.phrase, self.events, choice.phrase, falls
        )

    @property
    def hinge(self) -> tuple[str, ...]:
        """Ids that the behaviors behind it need: its phrase, if that falls with a gesture."""
        return (self.phrase,) if self.made.falls else ()

    @property
    def closing(self) -> Replacement:
        """Replacement of a speech that is nothing but the phrase's punctuation."""
        return Replacement((self.phrase, "end"), (self.phrase, "end"))

    def replacement(self, *, gaze_leads: bool) -> Replacement:
        """The points that stand for start and end of the reference. gaze_leads: before the phrase, as in Fig. 3.3."""
        leads = gaze_leads and self.gaze and self.phrase
        return Replacement(
            (self.gaze or self.phrase, "start"),
            self.made.by,
            start_of_words=(self.phrase, "start") if leads else None,
        )


def checking_back(
    parts: Parts, preceding: str, earlier: str, is_timed: bool, glance: str, gives_way: bool
) -> list[Operator]:
    """Profile `check-back`: phrase, look and point begin together and last until the other has looked.

    preceding: the speech or phrase before this one. earlier: the last one of the turn's earlier fragments. is_timed:
    the author has said when the reference starts. glance: the last one before it. "": there is none. gives_way: the
    look is the turn's last but for the one that is on the face when the last word ends.
    """
    gaze, point, phrase = parts.gaze, parts.point, parts.phrase
    operators: list[Operator] = []
    if phrase and preceding:
        operators.append(after(f"{preceding}:end", f"{phrase}:start"))
    if gaze:
        # What the author has said of its start replaces this, but nothing begins before the fragment does.
        if words := earlier if is_timed else preceding:
            operators.append(after(f"{words}:end", f"{gaze}:start"))
        if glance:
            operators.append(after(f"{glance}:stroke", f"{gaze}:start"))
        if phrase:
            seen = f"{gaze}:stroke+{LEAST_SEEN:g}" if gives_way else f"{phrase}:end"
            operators.append(after(seen, f"{gaze}:relax"))
    if gaze and phrase and not point:
        operators.append(after(f"{gaze}:stroke", f"{phrase}:start"))
    if point:
        operators.append(after(f"{gaze}:start", f"{point}:start"))
        operators.append(after(f"{gaze}:stroke", f"{point}:stroke_start"))
        if phrase:
            operators.append(same(f"{point}:stroke_start", f"{phrase}:start"))
            operators.append(after(f"{phrase}:end", f"{point}:stroke_end"))
        operators += [after(f"{event}:end", f"{point}:stroke_end") for event in parts.events]
    return operators


def from_there(earlier: str, leaves: str, later: str, stays: bool) -> Operator:
    """Order that says where a look or point begins: on the target of the `earlier` one, or at home (decision 0024).

    leaves: the sync point at which the earlier leaves its target. stays: it does so no sooner than the later begins.
    """
    return same(f"{earlier}:{leaves}", f"{later}:start") if stays else after(f"{earlier}:end", f"{later}:start")


def as_in_the_figure(parts: Parts, preceding: str, earlier: str, is_timed: bool, lead: Seconds) -> list[Operator]:
    """Profile `figure-3.3`: the gaze leads by a phrase, and the point is over when the phrase begins.

    lead: seconds from the gaze on target to the stroke of the point. The other parameters: see `checking_back`.
    """
    gaze, point, phrase = parts.gaze, parts.point, parts.phrase
    operators: list[Operator] = []
    if gaze and preceding and (phrase or not is_timed):
        # An earlier fragment's words may have begun by now: the gaze is on target with them, or as soon as it can.
        follows = preceding == earlier
        relate = after if follows else same
        operators.append(relate(f"{preceding}:start", f"{gaze}:stroke"))
        if point and follows:
            operators.append(after(f"{gaze}:start", f"{point}:start"))
    if point:
        operators.append(same(str(SyncRef(behavior=gaze, sync="stroke", offset=lead)), f"{point}:stroke_start"))
        if phrase:
            operators.append(same(f"{point}:stroke_end", f"{phrase}:start"))
    if phrase and preceding:
        operators.append(after(f"{preceding}:end", f"{phrase}:start"))
    return operators


def after(reference: str, sync: str) -> After:
    return After(ref=reference, syncs=(sync,))


def same(reference: str, sync: str) -> Synchronize:
    return Synchronize(ref=reference, syncs=(sync,))
