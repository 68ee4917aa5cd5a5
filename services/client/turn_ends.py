"""The end of a person's turn: by silence, by what the words so far leave open, and by where the person looks. Pure.

A robot that waits for a fixed silence either cuts people off where they search for a word, or answers late where
everybody would have known that the question was over. People wait for neither: the gap between turns is 0.2 s in the
middle, in ten languages, and 0.25 s more or less from one language to another (Stivers et al. 2009, PNAS 106), while
pauses within a turn last longer than that. What they go by is whether the words are complete (Sacks, Schegloff and
Jefferson 1974, Language 50), how it sounds, which words do not tell, and that a speaker who is done looks at the
other (Kendon 1967, Acta Psychologica 26). So the silence that ends a turn is counted in this order:

- words that end a sentence: `COMPLETE`; words after which something must follow: `OPEN`; else how it sounds, where
  somebody judges that (`hearing.turn_detector`): finished, `COMPLETE`, or not, `OPEN`; else `UNSURE`;
- by the language, as far from English as the gaps of its speakers are (`BY_LANGUAGE`);
- times `AT_THE_ROBOT` for who looks at the robot, times `AWAY` for who looks at something else;
- at least as long as this person's own pauses within turns have been lately, where the words leave it open.

`EndOfTurn` has the rule; another one, such as a model of the sound, is a class with its method `silence`.
"""

from collections import deque

from msgspec import Struct

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.text.ends import leaves_open

COMPLETE: Seconds = 0.35
UNSURE: Seconds = 0.7
OPEN: Seconds = 1.6
"""Silences that end a turn. The gap of people, the time in which a recognizer tells its last word, and for `OPEN` the
longest of nine in ten pauses within turns (Heldner and Edlund 2010, Journal of Phonetics 38)."""
BY_LANGUAGE: dict[str, Seconds] = {"da": 0.23, "ja": -0.23}
"""What the mean gap of a language differs from that of English by, where it is more than a fifth of a second."""
AT_THE_ROBOT = 0.7
AWAY = 1.3
PAUSES = 8
"""Number of a person's pauses that are remembered."""
LONGEST: Seconds = 2.5
"""Silence that ends any turn."""


class SoFar(Struct, frozen=True, kw_only=True):
    """A person's turn as it is in a silence.

    who: id of the person. text: the words so far, as they are known.
    spoken: seconds of voice so far.
    finished: how sure it is by the sound of what was said last that the person has finished; None: nobody judges.
    looks_at_robot: True: the person looks at the robot; None: nobody tells where this person looks.
    language: as a recognizer calls it, such as `en-GB`; empty: not known.
    pauses: the person's last pauses within turns, seconds.
    """

    who: str
    text: str
    spoken: Seconds
    finished: Probability | None = None
    looks_at_robot: bool | None = None
    language: str = ""
    pauses: tuple[Seconds, ...] = ()


class EndOfTurn:
    """Decides how long a silence ends a person's turn. Another decision is a class of yours with this method."""

    def silence(self, turn: SoFar) -> Seconds:
        """Return the silence after which the turn is over.

        turn: as it is now; asked again whenever it changes. A turn without words has an empty text.
        """
        language = turn.language.partition("-")[0].lower()
        is_open = leaves_open(turn.text, language)
        if is_open is None and turn.finished is not None:
            is_open = turn.finished < 0.5
        rest = OPEN if is_open else COMPLETE if is_open is False else UNSURE
        rest = max(0.15, rest + BY_LANGUAGE.get(language, 0.0))
        if turn.looks_at_robot is not None:
            rest *= AT_THE_ROBOT if turn.looks_at_robot else AWAY
        if is_open is not False and turn.pauses:
            rest = max(rest, sorted(turn.pauses)[len(turn.pauses) * 3 // 4] + 0.1)
        return min(rest, LONGEST)


class PersonPauses:
    """Pauses of each person within turns, the last few."""

    def __init__(self) -> None:
        self._pauses: dict[str, deque[Seconds]] = {}

    def note(self, person: str, pause: Seconds) -> None:
        """Remember that a person has paused so long and gone on."""
        self._pauses.setdefault(person, deque(maxlen=PAUSES)).append(pause)

    def of(self, person: str) -> tuple[Seconds, ...]:
        """Return the pauses of a person, the oldest first."""
        return tuple(self._pauses.get(person, ()))
