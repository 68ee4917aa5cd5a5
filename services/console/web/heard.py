"""Words of people, put to the speech that is seen: actions tell that somebody speaks, perception what. Pure."""

from engage_hri.schemas.perception import Utterance as Words
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.sections import Utterance

KEPT = 40
TOGETHER: Seconds = 1.5
"""Distance of the beginnings of a speech and of its words, up to which they are one."""


class Heard:
    """The newest words of people, by utterance."""

    def __init__(self) -> None:
        self._words: dict[tuple[str, str], Utterance] = {}

    def feed(self, words: Words, at: Seconds) -> None:
        """Take words. at: instant of the picture at which this much was known."""
        since = at - (words.at.seconds - words.began.seconds if words.at.clock == words.began.clock else 0.0)
        known = self._words.get((words.actor, words.id))
        if known is None or known.open or words.final:
            self._words[words.actor, words.id] = Utterance(words.actor, since, words.text, not words.final)
        for id in list(self._words)[: max(0, len(self._words) - KEPT)]:
            del self._words[id]

    def joined(self, said: list[Utterance]) -> list[Utterance]:
        """All that is said, by beginnings, with the words of people in it. said: without them."""
        left = [words for words in self._words.values() if words.words]
        found = []
        for each in said:
            own = [words for words in left if words.actor == each.actor and abs(words.since - each.since) < TOGETHER]
            if own and not each.words:
                left.remove(own[0])
                each = Utterance(each.actor, each.since, own[0].words, each.open)
            found.append(each)
        return sorted((*found, *left), key=lambda each: each.since)
