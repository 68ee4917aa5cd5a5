"""Random stories of many small blocks that come together, tied and disturbed: each story is one of `_KINDS`."""

from collections.abc import Callable, Sequence
from random import Random

from tests.judge import reading
from tests.judge.parts import Element, Made, offset
from tests.judge.story import Deed, DeedKind

SEVEN = reading.SEVEN_1_0
LOOK = ("start", "ready", "relax", "end")
FACE = ("start", "attackPeak", "relax", "end")
SHIFT = ("start", "end")
SPOKEN = ("start", "m1", "end")
NEAR = (-0.25, -0.05, 0.0, 0.0, 0.0, 0.0, 0.05, 0.25)
FAR = (-3.0, -1.5, -0.5, 0.0, 0.5)
"""Offsets; with far ones a point lies before the block began, mostly."""
INSTANT = (0.0, 0.0, 0.01, 0.3)
"""Seconds from the beginning of a block to what disturbs it at once."""
TEXTS = ('<text>yes <sync id="m1"/>no</text>', '<text>one two three <sync id="m1"/>four five six</text>')
LEANING = '<pose part="WHOLEBODY" lexeme="LEAN_FORWARD"/>'
MIXED = ("gesture", "gesture", "pointing", "head", "gaze", "gaze", "faceLexeme", "speech", "wait")
DEPENDENT = ("gesture", "head", "gaze", "pointing", "faceLexeme")
LAYERS = ("gazeShift", "headDirectionShift", "gaze", "gaze", "posture", "postureShift", "head", "pointing")
HANDS: tuple[dict[str, str], ...] = ({}, {"mode": "LEFT_HAND"}, {"mode": "RIGHT_HAND"}, {"mode": "BOTH_HANDS"})


def crowd(chance: Random) -> tuple[Deed, ...]:
    """A story."""
    return tuple(sorted(chance.choice(_KINDS)(chance), key=lambda deed: deed.at))


def _element(chance: Random, type: str, id: str) -> Element:
    thing = {"target": chance.choice(("cup", "box", "human"))}
    match type:
        case "gesture":
            return Element(type, id, SEVEN, "stroke", {"lexeme": "BEAT", **chance.choice(HANDS)})
        case "pointing" | "head":
            said = thing if type == "pointing" else {"lexeme": chance.choice(("NOD", "SHAKE"))}
            return Element(type, id, SEVEN, "stroke", said)
        case "gaze" | "posture":
            inner = LEANING if type == "posture" else ""
            return Element(type, id, LOOK, "ready", {} if inner else thing, inner)
        case "gazeShift" | "headDirectionShift" | "postureShift":
            inner = LEANING if type == "postureShift" else ""
            return Element(type, id, SHIFT, "end", {} if inner else thing, inner)
        case "faceLexeme":
            return Element(type, id, FACE, "attackPeak", {"lexeme": "SMILE", "amount": "0.8"})
        case "speech":
            return Element(type, id, SPOKEN, "start", {}, chance.choice(TEXTS))
        case _:
            return Element("wait", id, SHIFT, "end", {"duration": chance.choice(("0.05", "0.3", "1.0"))})


def _block(chance: Random, number: int, types: Sequence[str] = MIXED, most: int = 2) -> Made:
    elements = [_element(chance, chance.choice(types), f"e{each}") for each in range(chance.randint(1, most))]
    for one in elements:
        one.required = chance.random() < 0.06
    return Made(f"b{number}", "bml-1.0", "MERGE", elements, [])


def _ref(chance: Random, others: Sequence[Made], offsets: Sequence[float]) -> str:
    """A point of one of these blocks."""
    other = chance.choice(others)
    if chance.random() < 0.1:
        return offset(chance, f"{other.id}:bml:{chance.choice(SHIFT)}", offsets)
    one = chance.choice(other.elements)
    return offset(chance, f"{other.id}:{one.id}:{chance.choice((one.main, 'end', *one.points))}", offsets)


def _tie(chance: Random, block: Made, others: Sequence[Made], offsets: Sequence[float] = NEAR) -> None:
    """Tie some point of a block to another block, at the behavior or by a constraint; some are required."""
    one, ref = chance.choice(block.elements), _ref(chance, others, offsets)
    if chance.random() < 0.6:
        one.attributes[chance.choice(("start", one.main))] = ref
        return
    operator = chance.choice(("synchronize", "after", "before"))
    own = f"{one.id}:{chance.choice((one.main, *one.points))}"
    said = f'<constraint><{operator} ref="{ref}"><sync ref="{own}"/></{operator}></constraint>'
    block.constraints.append(f"<required>{said}</required>" if chance.random() < 0.15 else said)


def _ended(chance: Random, at: float, kind: DeedKind, block: str, behavior: str = "") -> Deed:
    return Deed(round(at + chance.choice(INSTANT), 2), kind, block, behavior=behavior)


def _flash(chance: Random) -> list[Deed]:
    """Behaviors with hardly any time: both ends are fixed, or something ends at once."""
    deeds: list[Deed] = []
    at = 0.0
    for number in range(chance.randint(4, 8)):
        block = _block(chance, number, (*MIXED, "gazeShift"))
        for one in block.elements:
            one.attributes["start"] = str(chance.choice((0.0, 0.0, 0.1, 0.5)))
            if chance.random() < 0.6:
                until = "end" if one.tag == "speech" else chance.choice(one.points[1:])
                one.attributes[until] = f"{one.id}:start+{chance.choice((0.01, 0.1, 0.4, 1.0))}"
        deeds.append(Deed(round(at, 2), "perform", block.id, block.xml()))
        if chance.random() < 0.3:
            deeds.append(_ended(chance, at, "interrupt", block.id, "e0"))
        at += chance.choice((0.0, 0.02, 0.1, 0.4))
    return deeds


def _twins(chance: Random) -> list[Deed]:
    """The same behavior twice, in one block or two, at one instant."""
    deeds: list[Deed] = []
    made: list[Made] = []
    for number in range(chance.randint(2, 6)):
        block = _block(chance, number)
        twin = chance.choice(chance.choice(made or [block]).elements)
        said = {name: text for name, text in twin.attributes.items() if name not in twin.points}
        block.elements.append(Element(twin.tag, "t", twin.points, twin.main, said, twin.inner))
        if made:
            ref = _ref(chance, made, (0.0,))
            for one in chance.sample(block.elements, 2):
                one.attributes[chance.choice(("start", one.main))] = ref
        at = round(chance.choice((0.0, 0.0, 0.2)) + number * 0.2, 2)
        deeds.append(Deed(at, "perform", block.id, block.xml()))
        made.append(block)
    return deeds


def _dialog(chance: Random) -> list[Deed]:
    """Speeches with dependents of their own and of the next block, interrupted, held and continued in between."""
    deeds: list[Deed] = []
    made: list[Made] = []
    at = 0.0
    for number in range(chance.randint(2, 5)):
        block = _block(chance, number, DEPENDENT, 3)
        for one in block.elements:
            one.attributes[chance.choice(("start", one.main))] = offset(chance, f"s:{chance.choice(SPOKEN)}", NEAR)
        block.elements.insert(0, _element(chance, "speech", "s"))
        if made and chance.random() < 0.6:
            _tie(chance, block, made[-1:])
        deeds.append(Deed(round(at, 2), "perform", block.id, block.xml()))
        made.append(block)
        for _ in range(chance.choice((0, 1, 2))):
            moment, one = round(at + chance.uniform(0.0, 4.0), 2), chance.choice(block.elements)
            drawn = chance.random()
            if drawn < 0.4:
                deeds.append(Deed(moment, "interrupt", block.id, behavior=one.id))
            elif drawn < 0.45:
                deeds.append(Deed(moment, "cancel", block.id))
            else:
                whole, part = chance.choice((("", ""), (block.id, ""), (block.id, one.id), (block.id, one.id)))
                until = round(moment + chance.choice((0.0, 0.1, 0.7, 2.5)), 2)
                deeds.append(Deed(moment, "hold", whole, behavior=part))
                deeds.append(Deed(until, "continue", whole, behavior=part))
        at += chance.choice((0.1, 0.4, 1.0, 2.0))
    return deeds


def _crowd(chance: Random) -> list[Deed]:
    """Eight to fifteen blocks within a second; half of them are tied to any earlier one."""
    count = chance.randint(8, 15)
    return _tied(chance, count, 0.5, gaps=(1.0 / count,), back=count)


def _relay(chance: Random) -> list[Deed]:
    """Each block is tied to two earlier ones, some to points that lie before it began, and may follow one."""
    return _tied(chance, chance.randint(4, 9), 1.0, ties=2, most=3, composed=0.15, follows=0.15)


def _layers(chance: Random) -> list[Deed]:
    """Shifts of gaze and posture beneath looks and postures, with strokes and nods above them."""
    return _tied(chance, chance.randint(3, 7), 0.7, LAYERS, most=3)


def _tangle(chance: Random) -> list[Deed]:
    """MERGE, APPEND and REPLACE in turns, all tied, and cancelled in the instant in which they begin."""
    return _tied(chance, chance.randint(3, 8), 0.7, (*MIXED, "gazeShift", "postureShift"), most=3, composed=0.4)


def _tied(
    chance: Random, count: int, share: float, types: Sequence[str] = MIXED, *, ties: int = 1, most: int = 2,
    composed: float = 0.0, follows: float = 0.0, back: int = 3, gaps: Sequence[float] = (0.0, 0.1, 0.4, 0.8),
) -> list[Deed]:  # fmt: skip
    """Blocks, of which a share is tied to those before. back: how many of these. composed: share not MERGE."""
    deeds: list[Deed] = []
    made: list[Made] = []
    at = 0.0
    for number in range(count):
        block = _block(chance, number, types, most)
        if made and chance.random() < composed:
            block.composition = chance.choice(("APPEND", "APPEND", "REPLACE"))
        if made and chance.random() < share:
            for _ in range(ties):
                _tie(chance, block, made[-back:], chance.choice((NEAR, NEAR, FAR)))
        is_next = made and block.composition != "REPLACE" and chance.random() < follows
        before = (made[-1].id,) if is_next else ()
        deeds.append(Deed(round(at, 2), "perform", block.id, block.xml(), follows=before))
        made.append(block)
        if chance.random() < max(0.05, composed / 3):
            deeds.append(_ended(chance, at, "cancel", block.id))
        at += chance.choice(gaps)
    return deeds


_KINDS: tuple[Callable[[Random], list[Deed]], ...] = (_crowd, _flash, _relay, _dialog, _layers, _twins, _tangle)
