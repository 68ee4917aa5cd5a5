"""Speeches as voices are given them: the words that are for the ear. Pure.

The text of a speech is its author's, with marks of Markdown, tags and emoji. Whatever voice says it, ours or another
one, it is given a speech of the words alone (services/text), with marks and markup where they belong in these. What
it tells of that one is told on of the author's: the places of words, and the estimates.
"""

from collections.abc import Sequence
from functools import lru_cache

from lxml import etree
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Speech
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.services.control.contract.body import Progress, Spoke
from engage_hri.services.text.ear import Heard, heard


def spoken(behavior: BlockBehavior) -> BlockBehavior:
    """The behavior that a body is given for one as it was asked for."""
    return _words_of(behavior) if isinstance(behavior, Speech) else behavior


def spoken_items(items: Sequence[EstimateItem]) -> list[EstimateItem]:
    """The items that a body is asked about."""
    return [replace(each, behavior=spoken(each.behavior)) for each in items]


def progress_of(behavior: BlockBehavior, progress: Progress) -> Progress:
    """Progress that a body tells of `spoken(behavior)`, as progress of the behavior."""
    if isinstance(behavior, Speech) and isinstance(progress, Spoke):
        return replace(progress, position=heard(behavior.text).written(int(progress.position)))
    return progress


def estimate_of(behavior: BlockBehavior, estimate: Estimate) -> Estimate:
    """Estimate of `spoken(behavior)` as one of the behavior; what will not be said is told in it."""
    if not isinstance(behavior, Speech) or (ear := heard(behavior.text)).text == behavior.text:
        return estimate
    words = tuple(replace(each, position=ear.written(each.position)) for each in estimate.words)
    told = "; ".join(each for each in (*ear.problems, estimate.degraded) if each)
    return replace(estimate, words=words, degraded=told if estimate.feasible else estimate.degraded)


@lru_cache(256)  # of a plan the same speeches are estimated again and again
def _words_of(speech: Speech) -> Speech:
    ear = heard(speech.text)
    if ear.text == speech.text:
        return speech
    marks = tuple(replace(each, position=ear.place(each.position)) for each in speech.marks)
    return replace(speech, text=ear.text, marks=marks, markup=_markup(speech, ear))


def _markup(speech: Speech, ear: Heard) -> str:
    """The markup around the words that are for the ear; as it is where it has other words than the text."""
    try:
        root = etree.fromstring(f"<speak>{speech.markup}</speak>".encode(), _PARSER)
    except etree.XMLSyntaxError:
        return speech.markup
    if not speech.markup or "".join("".join(map(str, root.itertext())).split()) != "".join(speech.text.split()):
        return speech.markup
    said: dict[int, str] = {}
    last = 0
    for letter, place in zip(ear.text, ear.places, strict=True):
        # A pause where a line ends has the place of the line break. It belongs to the letter before.
        last = place if letter.isspace() or not speech.text[place].isspace() else last
        said[last] = said.get(last, "") + letter
    places = iter([place for place, letter in enumerate(speech.text) if not letter.isspace()])

    def words(text: str | None) -> str:
        return "".join(each if each.isspace() else said.get(next(places), "") for each in text or "")

    def through(element: etree._Element) -> None:
        element.text = words(element.text)
        for child in element:
            through(child)
            child.tail = words(child.tail)

    through(root)
    return etree.tostring(root, encoding="unicode").removeprefix("<speak>").removesuffix("</speak>")


_PARSER = etree.XMLParser(resolve_entities=False, no_network=True, recover=False, remove_comments=True)
