"""Noun phrases for a reference that comes without any, from what the world knows of the objects.

The task is Dale and Reiter's (Computational interpretations of the Gricean maxims in the generation of referring
expressions, Cognitive Science 19, 1995): a noun, and modifiers that hold of the target and rule out others. Theirs
ends with one phrase; here the reference policy weighs words against gestures, so it is offered each phrase that no
other one of as few words beats, from "the square" to "the big red square". As with them the noun is always said,
the order of preference decides between equals, and what is not known of an object does not rule it out.

What was referred to in a turn and the one before is remembered, for what "it" can mean. Pure.
"""

import re
from collections.abc import Collection, Iterator, Sequence
from functools import cached_property
from itertools import combinations, pairwise
from typing import get_args

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Reference, SpeechOption
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.text import word_count
from engage_hri.schemas.units import Meters
from engage_hri.schemas.world import Entity, World, each_of
from engage_hri.services.generation.config import PhraseAttribute


class Named(Struct, frozen=True):
    """An object that a fragment refers to."""

    fragment: str
    object: str


class Discourse(Struct, frozen=True):
    """The objects referred to. named: in the turn. before: in the turn before it. heard_by: those who heard."""

    turn: str = ""
    heard_by: tuple[str, ...] = ()
    named: tuple[Named, ...] = ()
    before: tuple[Named, ...] = ()

    def in_turn(self, turn: str, addressees: tuple[str, ...]) -> "Discourse":
        """The discourse at a fragment of `turn`. For who has not heard the turn before nothing was referred to."""
        if turn == self.turn:
            return self
        before = self.named if {*addressees} <= {*self.heard_by} else ()
        return Discourse(turn=turn, heard_by=addressees, before=before)

    def naming(self, fragment: str, objects: Collection[str]) -> "Discourse":
        """The discourse after a fragment that refers, or is going to refer, to `objects`."""
        return replace(self, named=(*self.named, *(Named(fragment, each) for each in objects)))

    def without(self, fragment: str, unmentioned: Collection[str]) -> "Discourse":
        """The discourse after a fragment that has ended before it referred to the objects in `unmentioned`."""

        def said(named: tuple[Named, ...]) -> tuple[Named, ...]:
            return tuple(each for each in named if each.fragment != fragment or each.object not in unmentioned)

        return replace(self, named=said(self.named), before=said(self.before))

    def hearing(self, event: ConnectionEvent, robot: str) -> "Discourse":
        """The discourse after an event: a person who directs to something else ends the topic of "it"."""
        directs = event.kind == "directed_gaze" and event.state == "started" and event.initiator != robot
        if not directs or not event.objects or set(event.objects) == {self.topic}:
            return self
        return replace(self, named=(), before=())

    @property
    def topic(self) -> str:
        """The only object that was referred to: in the turn or, as long as nothing was in it, in the one before."""
        objects = {each.object for each in self.named or self.before}
        return objects.pop() if len(objects) == 1 else ""


NO_DISCOURSE = Discourse()


PHRASE_ATTRIBUTES: tuple[PhraseAttribute, ...] = ("color", "shape", "feature", "size")
"""Attributes that proposed phrases may say beside the noun, the most preferred first: absolute before relative, as
people do (Dale and Reiter 1995, after Pechmann 1989). `shape` only where the noun is something else."""
THIS_WITHIN: Meters = 0.65
"""Distance from the robot up to which "this" is proposed; beyond: "that". About the reach of an arm; ours, since
Appendix B says both."""
SPOKEN: tuple[PhraseAttribute, ...] = get_args(PhraseAttribute)
"""Attributes in the order in which English says modifiers, whatever the order of preference."""
MOST_MODIFIERS = 3
"""Number of modifiers in one phrase, at most: nobody listens to more, and all combinations have to be weighed."""
SIZES_APART = 1.25
"""Least ratio of two successive sizes at which the objects of a kind are divided into big and small ones."""

SHORTEST_NOUN = 3
"""Least number of letters that a noun in an id has: shorter words number things, as in `block-a`."""
NO_NOUNS = {"entity", "item", "marker", "node", "obj", "object", "piece", "tag", "thing", "track", "unknown"}
"""Words that trackers use for things that they know nothing of."""
_ID_SEPARATORS = re.compile(r"[\W_]+|(?<=[a-z])(?=[A-Z])")


class Property(Struct, frozen=True):
    """A word that holds of an object: the value of an attribute or, without `attribute`, the noun."""

    attribute: PhraseAttribute | None
    word: str


class Proposals(Struct, frozen=True):
    """References, each with phrases, and warnings of those for which the world knows too little."""

    references: tuple[Reference, ...]
    warnings: tuple[str, ...] = ()


def proposed(references: Sequence[Reference], world: World, discourse: Discourse = NO_DISCOURSE) -> Proposals:
    """Give phrases to those references that came without any. discourse: what was referred to before them."""
    objects = _Objects(world)
    made: list[Reference] = []
    warnings: list[str] = []
    for reference in references:
        if reference.options is None:
            is_the_topic = discourse.topic == reference.target
            options = phrases(reference.target, objects, is_the_topic=is_the_topic)
            for unknown in (each for each in each_of(reference.target) if not objects.describes(each)):
                called = _phrase(objects.noun(unknown), ())
                warnings.append(
                    f"{reference.id}: the world does not say what {unknown} is, so it is {called!r}: "
                    "give the entity a category or a name"
                )
            reference = replace(reference, options=options)
        made.append(reference)
        discourse = discourse.naming("", [reference.target])
    return Proposals(tuple(made), tuple(warnings))


def phrases(target: str, objects: "_Objects", *, is_the_topic: bool = False) -> tuple[SpeechOption, ...]:
    """Phrases for `target`, from short to long, each with its cost in words and its distractors.

    is_the_topic: the target alone was mentioned before, so that "it" can mean nothing else.
    """
    if len(ids := each_of(target)) > 1:
        return _phrases_together(ids, objects)
    options = [_option("it", frozenset())] if is_the_topic else []
    demonstrative = "this" if objects.distance(target) <= THIS_WITHIN else "that"
    if not objects.describes(target) and not objects.noun(target).word:
        demonstrative += " one"
    # The distractors of a deictic phrase are those of pointing: the reference policy computes them.
    options.append(SpeechOption(text=demonstrative, cost=word_count(demonstrative), deictic=True))
    return (*options, *_descriptions(target, objects))


def _phrases_together(ids: Sequence[str], objects: "_Objects") -> tuple[SpeechOption, ...]:
    """Phrases for several objects at once: "these", and what tells each one best, "the cup and the red plate"."""
    demonstrative = "these" if all(objects.distance(each) <= THIS_WITHIN for each in ids) else "those"
    best = [min(_descriptions(each, objects), key=lambda option: len(option.distractors)) for each in ids]
    others = frozenset(id for each in best for id in each.distractors) - {*ids}
    return (
        SpeechOption(text=demonstrative, cost=1, deictic=True),
        _option(" and ".join(each.text for each in best), others),
    )


def _descriptions(target: str, objects: "_Objects") -> Iterator[SpeechOption]:
    """Descriptions such as "the big square", without those that another one of as few words beats."""
    noun = objects.noun(target)
    others = objects.ids - {target}
    modifiers = [known for attribute in PHRASE_ATTRIBUTES for known in objects.properties(target, attribute)]
    candidates = []
    for count in range(min(len(modifiers), MOST_MODIFIERS) + 1):
        for chosen in combinations(modifiers, count):
            left = others.intersection(*(objects.may_be(each) for each in (noun, *chosen)))
            candidates.append(_option(_phrase(noun, chosen), left))
    offered: list[SpeechOption] = []
    # Stable: of phrases that cost and leave the same, the one of the preferred attributes comes first.
    for each in sorted(candidates, key=lambda option: (option.cost, len(option.distractors))):
        if not any(set(shorter.distractors) <= set(each.distractors) for shorter in offered):
            offered.append(each)
            yield each


def _phrase(noun: Property, modifiers: Sequence[Property]) -> str:
    said = sorted(modifiers, key=lambda each: SPOKEN.index(each.attribute) if each.attribute else len(SPOKEN))
    return " ".join(["the", *(each.word for each in said), noun.word or ("one" if said else "object")])


def _option(text: str, distractors: frozenset[str]) -> SpeechOption:
    return SpeechOption(text=text, cost=word_count(text), distractors=tuple(sorted(distractors)))


class _Objects:
    """The world's objects and the words that hold of them."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._holders: dict[Property, frozenset[str]] = {}

    @cached_property
    def _objects(self) -> dict[str, Entity]:
        return {entity.id: entity for entity in self._world.objects}

    @cached_property
    def _sizes(self) -> dict[str, str]:
        return _sizes(self._world.objects)

    @cached_property
    def ids(self) -> frozenset[str]:
        return frozenset(self._objects)

    def distance(self, id: str) -> float:
        """Metres from the robot, along the floor."""
        x, y, _ = self._objects[id].position
        return float((x * x + y * y) ** 0.5)

    def noun(self, id: str) -> Property:
        return Property(None, _noun(self._objects[id]))

    def describes(self, id: str) -> bool:
        """True if the world has more of an object than its id: a name, a category or an attribute."""
        return bool(_names(self._objects[id])) or any(self._words(self._objects[id], each) for each in SPOKEN)

    def properties(self, id: str, attribute: PhraseAttribute) -> tuple[Property, ...]:
        entity = self._objects[id]
        noun = _noun(entity)
        return tuple(Property(attribute, word) for word in self._words(entity, attribute) if word != noun)

    def may_be(self, known: Property) -> frozenset[str]:
        """Ids of the objects of which the word holds, or of which the world does not say whether it holds."""
        if known not in self._holders:
            ids = (id for id, entity in self._objects.items() if self._may_hold(entity, known))
            self._holders[known] = frozenset(ids)
        return self._holders[known]

    def _may_hold(self, entity: Entity, known: Property) -> bool:
        if known.attribute is None:
            names = _names(entity) or {noun_in(entity.id)} - {""}
            return not known.word or not names or known.word in names
        said = self._words(entity, known.attribute)
        return known.word in said or (not said and known.attribute != "feature")

    def _words(self, entity: Entity, attribute: PhraseAttribute) -> tuple[str, ...]:
        match attribute:
            case "feature":
                return entity.features
            case "size":
                word = entity.size or self._sizes.get(entity.id, "")
            case "shape":
                word = entity.shape
            case "color":
                word = entity.color
        return (word,) if word else ()


def _noun(entity: Entity) -> str:
    return entity.category or entity.shape or entity.name or noun_in(entity.id)


def _names(entity: Entity) -> set[str]:
    return {entity.category, entity.shape, entity.name} - {""}


def noun_in(id: str) -> str:
    """Noun in an id that a person has chosen: `cup` of `cup-2`, `coffee cup` of `coffeeCup`; "" of `obj-17`."""
    words = [word.lower() for part in _ID_SEPARATORS.split(id) if (word := part.rstrip("0123456789"))]
    telling = [word for word in words if word.isalpha() and (len(word) >= SHORTEST_NOUN or not word.isascii())]
    return "" if NO_NOUNS.intersection(telling) else " ".join(telling)


def _sizes(objects: Sequence[Entity]) -> dict[str, str]:
    """Sizes `big` and `small` by id, within each kind of object; none where all are about the same size."""
    kinds: dict[str, list[Entity]] = {}
    for entity in objects:
        if entity.extent > 0:
            kinds.setdefault(_noun(entity), []).append(entity)
    sizes: dict[str, str] = {}
    for members in kinds.values():
        ordered = sorted(members, key=lambda each: each.extent)
        steps = [larger.extent / smaller.extent for smaller, larger in pairwise(ordered)]
        if steps and max(steps) >= SIZES_APART:
            split = steps.index(max(steps)) + 1
            sizes |= {entity.id: "small" if place < split else "big" for place, entity in enumerate(ordered)}
    return sizes
