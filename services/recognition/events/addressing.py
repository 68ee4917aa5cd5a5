"""Addressees of what a person says. Pure.

At a table with several people most of what is said is for somebody else: in recorded meetings of four two sentences
of three. A robot that took all of it for its own would be asked things that nobody asked it, and its own questions
would be answered by people who talk with each other. So each speech has addressees, and the rules that find them
stand in one order, from what is certain to what is likely:

1. perception says so (`Utterance.to`);
2. the words call somebody else who is here by name: "I am Ann" calls nobody, if Ann says it;
3. there is nobody else: one person with the robot speaks to it; and so does who types a line;
4. the gaze: whose face the speaker looks at for most of the speech. In groups of four, whom a speaker looks at is in
   77 of 100 looks the addressee (Vertegaal and others, CHI 2001). People also look away while they think, so that no
   look at a face says nothing;
5. an answer goes to who spoke to the speaker last, unless the speaker has said something since; and to the robot as
   long as it waits for the speaker's answer. Who spoke last is who stopped last: "mhm" within a question is none;
6. more words go to those to whom the words before went, unless perception will say with the words to whom they are.

If none of them finds anybody, it is not known, and nothing follows from it. The gaze is known when the speech is
over, the words later still. Rules 1 to 3 decide as soon as they apply; the others at the end.

Before all of them: a sound that is over, and of which no words have come where they would have come, is for nobody.
It is a cough, or a laugh at what a neighbor says.
"""

from collections.abc import Iterable, Mapping
from math import inf
from typing import Literal

from msgspec import Struct, field

from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.limits import ROUNDING
from engage_hri.services.recognition.events.listener_sign import SignPart
from engage_hri.services.text.calling import called

LONGEST_UNKNOWN: Seconds = 3.0
"""Time after which a sound that still goes on is speech, and it is decided by the looks so far to whom. Ours."""
WORDS_AFTER: Seconds = 1.0
"""Time after a sound for which its words are waited for: without any it is no speech; perception may say with them to
whom they are, if it ever has; and they may call somebody by name. Ours."""
LONGEST_UNTOLD: Seconds = 15.0
"""As `LONGEST_UNKNOWN`, where perception tells addressees: it may do so only with the words, when the speech is over.
A question of the robot waits so long, at most, until it is known that what somebody else says is no answer. Ours."""
Addressees = frozenset[str]
NOBODY: Addressees = frozenset()
WHOEVER: Addressees = frozenset(("",))
"""Of a speech of the robot of which nobody has said to whom it is."""


def renamed_in(to: Addressees, other: str, kept: str) -> Addressees:
    """Addressees with a person's present id in place of another of theirs."""
    return to - {other} | {kept} if other in to else to


class Spoken(Struct, kw_only=True):
    """A speech. to: its addressees; None: they are not known yet. until: None: it goes on."""

    actor: str
    since: Seconds
    to: Addressees | None = None
    until: Seconds | None = None
    sound: Literal["unsure", "speech", "noise"] = "speech"
    """What it is: noise if no words have come of it, unsure as long as these would tell that it is no cough."""
    noted_at: Seconds = inf
    """Time from which on it counts for what others say; infinite: it does not yet."""

    @property
    def named(self) -> Addressees:
        """Ids of the addressees, as far as they are known."""
        return NOBODY if self.to is None or self.to is WHOEVER else self.to

    def is_to(self, actor: str) -> bool:
        return self.to is WHOEVER or (self.to is not None and actor in self.to)

    def overlaps(self, since: Seconds, until: Seconds | None = None) -> bool:
        """True if the speech and this time have more than an instant in common. until: None: it goes on."""
        return since < (inf if self.until is None else self.until) and self.since < (inf if until is None else until)


class FaceTimes(Struct):
    """Time for which a speaker has looked at each face since the speech began."""

    at: Seconds
    """Time up to which it is counted."""
    face: str = ""
    """Whose face the speaker looks at now; "": nobody's."""
    looked: dict[str, Seconds] = field(default_factory=dict)

    def turns(self, face: str, at: Seconds) -> None:
        """Count the look until `at`; from then on it is at another face."""
        if self.face and at > self.at:
            self.looked[self.face] = self.looked.get(self.face, 0.0) + at - self.at
        self.face, self.at = face, max(at, self.at)

    def rename(self, other: str, kept: str) -> None:
        """Take the face of somebody for that of who they turn out to be."""
        self.face = kept if self.face == other else self.face
        self.looked[kept] = self.looked.pop(other, 0.0) + self.looked.get(kept, 0.0)

    def most(self, since: Seconds) -> str:
        """The face that was looked at for more than half of the time from `since` to `at`; "": none."""
        half = (self.at - since) / 2 + ROUNDING
        return next((face for face, lasted in self.looked.items() if lasted > half), "")

    def most_from(self, face: str, since: Seconds) -> Seconds:
        """Time from which on this face is the one, if the look stays; infinite: it is not looked at now."""
        by = 2 * (self.at - self.looked.get(face, 0.0) + 2 * ROUNDING) - since  # `most` says so by then
        return by if self.face == face else inf


class OwnSpeech(Spoken, kw_only=True):
    """A speech of a person, and what tells to whom it is."""

    part: SignPart
    """What the conversation is told of it."""
    faces: FaceTimes
    company: Addressees = NOBODY
    """Other people who were here."""
    told: Addressees | None = None
    """Addressees by perception."""
    words: str = ""
    worded_at: Seconds = -inf
    """Time when its first words became known."""
    is_into_turn: bool = False
    """True if it began while the robot had the floor, as far as is known."""
    is_decided: bool = False
    """True once nothing more of it is waited for."""
    is_heard: bool = False
    """True once it has been told to the conversation."""
    is_beside: bool = False
    """True if it began while the robot said something to others."""


def certain(speech: OwnSpeech, robot: str, names: Mapping[str, str], *, is_line: bool) -> Addressees | None:
    """Addressees by rules 1 to 3; None if these do not say. is_line: it was typed, which one does to the robot."""
    if speech.told is not None:
        return speech.told
    if found := called(speech.words, names) - {speech.actor}:
        return found
    return None if speech.company and not is_line else frozenset((robot,))


def likely(
    speech: OwnSpeech,
    spoken: Iterable[Spoken],
    *,
    by: Seconds,
    within: Seconds,
    awaited_by: Addressees,
    is_untold: bool,
) -> Addressees:
    """Addressees by rules 4 to 6, once the speech is over, or so far.

    spoken: what was said before, by all. by: when it is decided: what is known later does not count. within: time
    after somebody's words in which the other's are about them, as long as people take to answer. awaited_by: who has
    asked the speaker, and still waits for the answer.
    is_untold: perception will say with the words to whom it is, and has not yet.
    """
    if face := speech.faces.most(speech.since):
        return frozenset((face,))
    actor, at = speech.actor, speech.since
    # Those that it comes during, or at most `within` after: few of all.
    recent = [each for each in spoken if each.since < at and (each.until is None or at <= each.until + within)]
    known = [each for each in recent if each.noted_at <= by]
    heard = [each for each in known if (each.actor == actor or each.is_to(actor)) and each.sound == "speech"]
    # Who still goes on is the last, however that may end.
    last = max(heard, key=lambda each: (at if each.until is None else min(each.until, at), each.since), default=None)
    if last is None:
        return awaited_by
    if last.actor != speech.actor:
        return frozenset((last.actor,))
    return NOBODY if is_untold or last.to is None else last.to
