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

import re
from collections import deque
from collections.abc import Iterable

from msgspec import Struct

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.text.ends import ends

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

_OPEN = {
    "en": "a an the and or but because so if when that which who whose with without of to from for in on at by as"
    " than my your his her its our their this these those is are was were am be do does did can could will would"
    " shall should may might must have has had not very um uh er hm well like maybe i you we they he she it let's",
    "de": "ein eine einen einem einer der die das den dem des und oder aber weil wenn dass ob mit ohne von zu zum zur"
    " aus für in im an am auf bei als wie mein dein sein ihr unser dieser diese dieses ist sind war waren kann könnte"
    " will würde soll muss hat habe nicht sehr äh ähm hm also vielleicht ich du wir er sie es",
    "fr": "un une le la les des du de et ou mais parce que si quand avec sans pour dans sur à au aux mon ma mes ton"
    " ta est sont était peut veux pas très euh ben je tu nous vous il elle on",
    "es": "un una el la los las del de y o pero porque que si cuando con sin para por en a al mi tu su es son era"
    " puede quiero no muy eh pues yo tú nosotros él ella",
    "it": "un uno una il lo la i gli le del della di e o ma perché che se quando con senza per in a al mio tuo suo è"
    " sono era può voglio non molto eh allora io tu noi lui lei",
}
"""Words behind which a turn is not over, by language: more of the sentence must follow."""
_OPEN_WORDS = {language: frozenset(words.split()) for language, words in _OPEN.items()}


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


def leaves_open(text: str, language: str = "") -> bool | None:
    """Tell whether more must follow these words; None: they do not tell.

    language: as `en`; one whose words nobody knows, or none: the words of all languages count.
    """
    stripped = text.rstrip()
    if not stripped or stripped.endswith(("...", "…", ",", "-", "–", ":")):
        return True if stripped else None
    if ends(f"{stripped} ", len(stripped)):
        return False
    *_, last = ("", *re.findall(r"[\w']+", stripped.casefold().replace("’", "'")))
    listed = _OPEN_WORDS.get(language)
    known: Iterable[frozenset[str]] = [listed] if listed is not None else _OPEN_WORDS.values()
    return True if any(last in words for words in known) else None


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
