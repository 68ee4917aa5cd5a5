"""Behaviors that replace one reference, and ids that the fragment does not use."""

from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior, Event, Gaze, Hand, Pointing, Reference, Speech, Timing
from engage_hri.schemas.fragments import ReferenceChoice, TurnFragment
from engage_hri.services.generation.block.rewriting import Point, Replacement
from engage_hri.services.generation.turns.policy import TurnPlan


class Made(Struct, frozen=True):
    """Ids of the behaviors that a block has for one reference; "": it has none.

    words: of its phrase, as chosen. falls: the phrase falls with a gesture (see `Parts`).
    """

    reference: str
    object: str
    gaze: str = ""
    point: str = ""
    phrase: str = ""
    event: str = ""
    words: str = ""
    falls: bool = False

    @property
    def gestures(self) -> tuple[str, ...]:
        return tuple(filter(None, (self.gaze, self.point)))


class Mention(Struct, frozen=True):
    """An object that a block refers to. by: the sync point from which on it has been referred to."""

    object: str
    by: Point


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
        self.gaze = self.point = self.phrase = self.event = self.glance = ""
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
            self.event = names.fresh(f"{reference.id}-event")
            self.behaviors.append(
                Event(
                    id=self.event,
                    kind="directed_gaze",
                    responder=turn.addressee,
                    objects=(reference.target,),
                    cause="reference",
                    anchors=tuple(anchors),
                    turn=turn.turn,
                    timing=(Timing("start", f"{self.gaze}:start"),),
                    needs=tuple(filter(None, (self.gaze, self.point))),
                )
            )

        falls = bool(self.phrase and looks and not required)
        self.made = Made(
            reference.id, reference.target, self.gaze, self.point, self.phrase, self.event, choice.phrase, falls
        )

    @property
    def hinge(self) -> tuple[str, ...]:
        """Ids that the behaviors behind it need: its phrase, if that falls with a gesture."""
        return (self.phrase,) if self.made.falls else ()

    @property
    def closing(self) -> Replacement:
        """Replacement of a speech that is nothing but the phrase's punctuation."""
        return Replacement((self.phrase, "end"), (self.phrase, "end"))

    @property
    def mention(self) -> Mention:
        """The reference's object, and the end of its phrase or gesture."""
        return Mention(self.reference.target, self.replacement(gaze_leads=False).end)

    def replacement(self, *, gaze_leads: bool) -> Replacement:
        """The points that stand for start and end of the reference. gaze_leads: before the phrase, as in Fig. 3.3."""
        if self.phrase:
            end = (self.phrase, "end")
        else:
            end = (self.point, "stroke_end") if self.point else (self.gaze, "stroke")
        leads = gaze_leads and self.gaze and self.phrase
        return Replacement(
            (self.gaze or self.phrase, "start"), end, start_of_words=(self.phrase, "start") if leads else None
        )
