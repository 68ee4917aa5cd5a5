"""A sign of a listener, and what it may turn out to be. Pure.

While one speaks the other nods, says "uh-huh", laughs, or interrupts; and the answer often begins before the last
word is over. All of these begin alike. So such a sign has several readings, of which what becomes known excludes one:

| what is known | excludes |
|---|---|
| its words are a listener's ("uh-huh") | that it interrupts |
| it has other words | that it is a backchannel |
| it goes on when the speaker's turn is over: it is the answer | that it is a backchannel |
| its speech is longer than a backchannel, or than words take to come, and they have not | that it is a backchannel |
| it is over, and nothing of this has been seen | that it interrupts |

So it is, too, for who stands by, and says something to the robot while that speaks to others. But there somebody may
say more before it is decided, for it is known only at the end, or after some seconds, whether it is for the robot.

What one does at the same time is one sign: who nods and says "uh-huh" gives one backchannel. Without this the nod
would be the answer if it begins a moment after the "uh-huh", and a backchannel if it begins a moment before. A sign
is decided once: when one reading is left, at the latest at its `deadline`. Thesis 2.2.3 and 2.2.4.
"""

from math import inf
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Seconds

WORDS_WAIT: Seconds = 1.5
"""Time from the beginning of a speech in which its words may come, where somebody tells words. Laughter has none."""


class SignPart(Struct):
    """A speech, or a gesture. until: None: it goes on. words: of speech: as far as they are known by then.

    taken_for: of speech: what it has turned out to be.
    """

    action: Action
    since: Seconds
    confidence: Probability = 1.0
    until: Seconds | None = None
    words: str = ""
    taken_for: Literal["", "noise", "backchannel", "turn"] = ""


class ListenerSign(Struct):
    """All that a listener does at one time, in the order in which it began.

    is_wordless: the words of its speech have not come in time. is_beside: the robot speaks to others.
    outlasting: a gesture with which the person has gone on when the robot's turn was over, while words of what was
    said before it may come: it is the answer, unless these are.
    """

    parts: list[SignPart]
    is_wordless: bool = False
    is_beside: bool = False
    outlasting: SignPart | None = None

    @property
    def since(self) -> Seconds:
        return self.parts[0].since

    @property
    def until(self) -> Seconds | None:
        """Time at which the last of it was over; None: it goes on."""
        ends = [part.until for part in self.parts]
        return None if None in ends else max(end for end in ends if end is not None)

    @property
    def speeches(self) -> list[SignPart]:
        return [part for part in self.parts if part.action == "speak"]

    @property
    def confidence(self) -> Probability:
        return min(part.confidence for part in self.parts)

    def going_on(self, action: Action | None = None) -> list[SignPart]:
        """Parts that go on. action: only those."""
        return [part for part in self.parts if part.until is None and action in (None, part.action)]

    def deadline(self, limit: Seconds, words_after: Seconds = 0.0) -> Seconds:
        """Time at which its speech decides it, if its words do not; infinite: it has no speech, or that has decided.

        limit: longest speech that is a backchannel. words_after: time after the speech for which words may come.
        """
        if not self.speeches or self.is_wordless:
            return inf
        speech = self.speeches[-1]
        return (
            speech.since + limit
            if speech.until is None
            else max(speech.since + WORDS_WAIT, speech.until + words_after)
        )
