"""Lips of several people, and of whom a voice is: of the one whose lips move with it. Pure.

    lips = Lips()
    lips.hear(samples, at)              # sound in which one of them may speak, as it comes
    lips.see("face_3", mouth, at)       # the gap between somebody's lips, picture after picture
    who = lips.speaker(since, until)    # of the voice of that time; empty: that cannot be told, or not yet

Who chews or smiles moves the lips, too, but not with the sound: a voice that grows louder comes out of a mouth that
opens, and one that pauses has closed it. So what counts is how far lips open and close, from one picture to the
next, as the loudness grows and falls. How wide they are open does not: who smiles as somebody begins is no speaker.
"""

from collections import deque

import numpy as np

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.perception.hearing.voice import RATE, Samples

SLOT: Seconds = 0.02
"""Time over which loudness is taken."""
KEPT: Seconds = 4.0
BEFORE: Seconds = 0.4
"""Time before a voice in which lips are closed."""
SOUND: tuple[Seconds, Seconds] = (-0.05, 0.1)
"""Sound that belongs to a picture of lips, from its instant: they open a little before it comes."""
PICTURES = 8
"""Fewest pictures of somebody that tell; with `BEFORE` they are there 0.2 s after the onset, of 15 a second."""
OPENS: Probability = 0.003
"""Least share of a face by which lips of who speaks go with the loudness from one picture to the next, standard
deviation. Those of rendered people do by 0.006 to 0.008, and of who chews by 0.003 at most, by chance."""
CLEAR = 2.0
"""How many times as far they open as those of the next one."""


class Lips:
    """Lips of all who are seen, and the loudness of one channel of sound, of the last seconds."""

    def __init__(self) -> None:
        self._loud: deque[tuple[Seconds, float]] = deque(maxlen=round(KEPT / SLOT))
        self._mouths: dict[str, deque[tuple[Seconds, Probability]]] = {}

    def hear(self, samples: Samples, at: Seconds) -> None:
        """Take the next sound. at: instant of its first sample."""
        size = round(SLOT * RATE)
        for first in range(0, len(samples), size):
            power = np.mean(samples[first : first + size].astype(np.float64) ** 2)
            self._loud.append((at + first / RATE, float(power) ** 0.25))  # as ears take it: between level and its log

    def see(self, person: str, mouth: Probability, at: Seconds) -> None:
        """Take the gap between the lips of somebody in a picture. at: instant of the picture."""
        self._mouths.setdefault(person, deque()).append((at, mouth))
        for other, mouths in [*self._mouths.items()]:
            while mouths and mouths[0][0] < at - KEPT:
                mouths.popleft()
            if not mouths:
                del self._mouths[other]

    def are_seen(self, now: Seconds) -> bool:
        """True if somebody's lips are in view."""
        return any(mouths[-1][0] > now - 2 * BEFORE for mouths in self._mouths.values())

    def speaker(self, since: Seconds, until: Seconds) -> str:
        """Find whose voice it is that was heard then. Empty: that cannot be told."""
        opens = sorted(
            ((self._opens(mouths, since, until), who) for who, mouths in self._mouths.items()), reverse=True
        )
        most, who = opens[0] if opens else (0.0, "")
        rest = max(opens[1][0], 0.0) if len(opens) > 1 else 0.0
        return who if most >= max(OPENS, CLEAR * rest) else ""

    def _opens(self, mouths: deque[tuple[Seconds, Probability]], since: Seconds, until: Seconds) -> float:
        """Measure how far a mouth opens and closes with the loudness: by what both have in common."""
        first, last = SOUND
        times, levels = (
            (np.array(each) for each in zip(*self._loud, strict=True)) if self._loud else (np.zeros(0),) * 2
        )
        pairs = []
        for at, mouth in mouths:
            near = (times >= at + first) & (times < at + last)
            if since - BEFORE <= at <= until and near.any():
                pairs.append((float(levels[near].mean()), mouth))
        if len(pairs) < PICTURES:
            return 0.0
        louder, opening = np.diff(np.array(pairs), axis=0).T
        spread = float(louder.std())
        return float((louder * opening).mean()) / spread if spread > 0 else 0.0
