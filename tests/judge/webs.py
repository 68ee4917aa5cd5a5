"""Random stories of blocks that hang together: most of their behaviors are tied to other blocks, and share parts.

What blocks wait for goes in both directions here: a tie names a block that came earlier, while a part, or a turn
(APPEND), may be waited for by the one that came first.
"""

from collections.abc import Sequence
from random import Random

from tests.judge import reading
from tests.judge.parts import Element, Made, offset
from tests.judge.story import Deed, DeedKind

GAPS = (0.0, 0.0, 0.25, 0.25, 0.5, 0.5, 1.0, 2.0)
TIED = 0.75
"""Share of behaviors that are tied to something."""
ABROAD = 0.65
"""Share of ties that name another block."""
OFFSETS = (-1.0, -0.25, 0.0, 0.0, 0.0, 0.0, 0.25, 1.0)
SEVEN = reading.SEVEN_1_0
LOOK = ("start", "ready", "relax", "end")


def web(chance: Random) -> tuple[Deed, ...]:
    """The deeds of one story."""
    deeds: list[Deed] = []
    made: list[Made] = []
    at = 0.0
    for number in range(chance.randint(3, 7)):
        composition = chance.choices(("MERGE", "APPEND", "REPLACE"), (12, 6, 1))[0] if number else "MERGE"
        block = _block(chance, f"b{number}", composition, made)
        deeds.append(Deed(round(at, 2), "perform", block.id, block.xml()))
        made.append(block)
        kinds: tuple[DeedKind, ...] = ("interrupt", "cancel")
        for kind, share in zip(kinds, (0.3, 0.05), strict=True):
            if chance.random() < share:
                behavior = chance.choice(block.elements).id if kind == "interrupt" else ""
                moment = round(at + chance.choice((0.25, 0.5, 1.0, 2.0, 3.0)), 2)
                deeds.append(Deed(moment, kind, block.id, behavior=behavior))
        at += chance.choice(GAPS)
    return tuple(sorted(deeds, key=lambda deed: deed.at))


def _block(chance: Random, id: str, composition: str, others: Sequence[Made]) -> Made:
    elements: list[Element] = []
    for number in range(chance.choice((1, 1, 2, 2, 3, 4))):
        one = _element(chance, number)
        one.required = chance.random() < 0.05
        if chance.random() < TIED:
            for point in chance.sample(_timed(one), 2 if chance.random() < 0.15 else 1):
                if ref := _ref(chance, elements, others):
                    one.attributes[point] = ref
        elements.append(one)
    block = Made(id, "bml-1.0", composition, elements, [])
    if others and chance.random() < 0.2:
        one = chance.choice(elements)
        operator = chance.choice(("synchronize", "after", "before"))
        ref, own = _abroad(chance, others), f"{one.id}:{chance.choice(one.points)}"
        block.constraints.append(f'<constraint><{operator} ref="{ref}"><sync ref="{own}"/></{operator}></constraint>')
    return block


def _element(chance: Random, number: int) -> Element:
    drawn = chance.random()
    if drawn < 0.3:
        hand = chance.choice(({}, {"mode": "LEFT_HAND"}, {"mode": "RIGHT_HAND"}, {"mode": "BOTH_HANDS"}))
        return Element("gesture", f"g{number}", SEVEN, "stroke", {"lexeme": "BEAT", **hand})
    if drawn < 0.4:
        return Element("pointing", f"p{number}", SEVEN, "stroke", {"target": chance.choice(("cup", "box"))})
    if drawn < 0.6:
        return Element("gaze", f"l{number}", LOOK, "ready", {"target": chance.choice(("cup", "box", "human"))})
    if drawn < 0.65:
        return Element("gazeShift", f"x{number}", ("start", "end"), "end", {"target": chance.choice(("cup", "box"))})
    if drawn < 0.75:
        return Element("head", f"h{number}", SEVEN, "stroke", {"lexeme": chance.choice(("NOD", "SHAKE"))})
    if drawn < 0.9:
        text = '<text>one two <sync id="m1"/>three four <sync id="m2"/>five six</text>'
        return Element("speech", f"s{number}", ("start", "m1", "m2", "end"), "start", {}, text)
    duration = chance.choice(("0.5", "1.0", "3.0"))
    return Element("wait", f"w{number}", ("start", "end"), "end", {"duration": duration})


def _timed(one: Element) -> tuple[str, ...]:
    """Points that can be tied at the behavior itself."""
    if one.tag in ("speech", "wait"):
        return ("start", "end")
    return ("start", "ready", "strokeEnd", "end") if one.points == SEVEN else one.points


def _ref(chance: Random, before: Sequence[Element], others: Sequence[Made]) -> str:
    if others and chance.random() < ABROAD:
        return _abroad(chance, others)
    if before:
        one = chance.choice(before)
        return offset(chance, f"{one.id}:{chance.choice(one.points)}", OFFSETS)
    return ""


def _abroad(chance: Random, others: Sequence[Made]) -> str:
    """A point of another block; the later it came, the likelier."""
    other = chance.choice((*others, *others[-3:], *others[-2:]))
    if chance.random() < 0.15:
        return offset(chance, f"{other.id}:bml:{chance.choice(('end', 'end', 'start'))}", OFFSETS)
    one = chance.choice(other.elements)
    return offset(chance, f"{other.id}:{one.id}:{chance.choice(one.points)}", OFFSETS)
