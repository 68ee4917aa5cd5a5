"""Random stories: blocks with everything that BML has, alone or in streams. The same seed gives the same story."""

from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any, Literal
from xml.sax.saxutils import escape

from tests.judge import reading
from tests.judge.crowds import crowd
from tests.judge.parts import Element, Made, offset
from tests.judge.story import Deed, DeedKind, Story
from tests.judge.webs import web

Kind = Literal["alone", "streams", "sentences", "webs", "crowds"]
KINDS: tuple[Kind, ...] = ("alone", "streams", "sentences", "webs", "crowds")
TARGETS = ("cup", "box", "lamp", "human")
SENTENCES = (
    "This one here.",
    "And now the next piece goes there.",
    "Good.",
    "Look at it, it is small and red.",
    "Yes, please.",
)
LEXEMES = ("SMILE", "RAISE_BROWS", "LOWER_BROWS", "OPEN_MOUTH")
POSES = ("LEAN_FORWARD", "LEAN_BACK", "TURN_LEFT", "TURN_RIGHT")
HANDS = ("LEFT_HAND", "RIGHT_HAND", "")
WEIGHTS = {
    "gaze": 6, "pointing": 6, "gesture": 6, "head": 6, "speech": 7, "posture": 2, "face": 1, "faceLexeme": 2,
    "faceFacs": 1, "gazeShift": 3, "headDirectionShift": 1, "faceShift": 1, "postureShift": 1, "wait": 2, "emit": 1,
}  # fmt: skip
DISTURBANCES: tuple[DeedKind, ...] = ("cancel", "interrupt")
"""What may come from outside while blocks run. A new kind of request is named here and in `playing.Player.do`."""
HELD = (0.05, 0.2, 0.6, 1.5, 4.0)
"""Seconds for which something is held."""


def story(seed: int, number: int, kind: Kind, *, faults: bool = False, holds: bool = False) -> Story:
    """A story. holds: the same, and parts of it are held for a while."""
    name = f"{seed}/{kind}/{number}"
    chance = Random(name)
    make = {"alone": _alone, "streams": _stream, "sentences": _sentences, "webs": web, "crowds": crowd}[kind]
    deeds = make(chance)
    if holds:
        deeds = _with_holds(Random(f"{name}/holds"), deeds)
    if not faults:
        return Story(deeds, seed=name)
    if chance.random() < 0.4:
        return Story(deeds, lies=_lies(chance), seed=name)
    return Story(deeds, _faults(chance), seed=name)


# -- stories ---------------------------------------------------------------------------------------------------------


def _alone(chance: Random) -> tuple[Deed, ...]:
    return (Deed(0.0, "perform", "b0", _block(chance, "b0", _dialect(chance), "MERGE", ()).xml()),)


def _stream(chance: Random) -> tuple[Deed, ...]:
    deeds: list[Deed] = []
    made: list[Made] = []
    at, gap, dialect = 0.0, 0.0, _dialect(chance)
    for number in range(chance.randint(2, 5)):
        composition = chance.choices(("MERGE", "APPEND", "REPLACE"), (7, 2, 1))[0] if number else "MERGE"
        # The longer ago, the likelier the others have ended: then the block would be refused for naming them.
        live = made[-2:] if chance.random() > gap / 3.0 else ()
        block = _block(chance, f"b{number}", dialect, composition, live)
        follows = (chance.choice(made).id,) if made and composition != "REPLACE" and chance.random() < 0.12 else ()
        deeds.append(Deed(round(at, 2), "perform", block.id, block.xml(), follows=follows))
        made.append(block)
        for kind in DISTURBANCES:
            if chance.random() < 0.12 and block.elements:
                behavior = chance.choice(block.elements).id if kind == "interrupt" else ""
                moment = round(at + chance.uniform(0.0, 3.5), 2)
                deeds.append(Deed(moment, kind, block.id, behavior=behavior))
        gap = chance.choice((0.0, 0.1, 0.3, 0.8, 1.5, 2.5, chance.uniform(0.0, 4.0)))
        at += gap
    return tuple(sorted(deeds, key=lambda deed: deed.at))


def _sentences(chance: Random) -> tuple[Deed, ...]:
    """A block of sentences that nobody times, with behaviors that depend on them; two of those may share a part."""
    speeches = [_speech(chance, f"s{number}") for number in range(chance.randint(2, 4))]
    elements = list(speeches)
    seven = reading.SEVEN_1_0
    dependents = [
        Element("head", "n", seven, "stroke", {"lexeme": "NOD"}),
        Element("gesture", "l", seven, "stroke", {"lexeme": "BEAT", "mode": "LEFT_HAND"}),
        Element("pointing", "r", seven, "stroke", {"target": "box", "mode": "RIGHT_HAND"}),
        Element("gaze", "g", ("start", "ready", "relax", "end"), "ready", {"target": "human"}),
        Element("faceLexeme", "f", ("start", "attackPeak", "relax", "end"), "attackPeak", {"lexeme": "SMILE"}),
    ]
    constraints = []
    chosen = chance.sample(dependents, chance.randint(0, 3))
    if chance.random() < 0.4:
        twins = [
            Element("head", id, seven, chance.choice(("stroke", "strokeEnd", "relax", "end")), {"lexeme": "NOD"})
            for id in ("n", "n2")
        ]
        chosen = [*twins, *(each for each in chosen if each.id != "n")]
    for one in chosen:
        to = chance.choice(speeches)
        ref = offset(chance, f"{to.id}:{chance.choice(to.points)}", (0.0, 0.0, 0.2, -0.2))
        if chance.random() < 0.25:
            operator = chance.choice(("after", "synchronize"))
            own = f"{one.id}:{chance.choice(('start', one.main))}"
            constraints.append(f'<constraint><{operator} ref="{ref}"><sync ref="{own}"/></{operator}></constraint>')
        else:
            one.attributes[chance.choice(("start", one.main))] = ref
        elements.insert(chance.randint(0, len(elements)), one)
    if chance.random() < 0.3:
        first, second = chance.sample(speeches, 2)
        constraints.append(
            f'<constraint><after ref="{first.id}:end"><sync ref="{second.id}:start"/></after></constraint>'
        )
    return (Deed(0.0, "perform", "b0", Made("b0", "bml-1.0", "MERGE", elements, constraints).xml()),)


def _with_holds(chance: Random, deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """Hold behaviors, blocks and the robot, and let them go again, by the same name or by a wider one."""
    blocks = [deed for deed in deeds if deed.kind == "perform"]
    steered: list[Deed] = []
    for _ in range(chance.choice((1, 1, 2, 3))):
        deed = chance.choice(blocks)
        block = chance.choice((deed.block, deed.block, ""))
        behaviors = [*reading.read(deed.xml).behaviors]
        behavior = chance.choice(behaviors) if block and behaviors and chance.random() < 0.6 else ""
        since = round(deed.at + chance.uniform(0.0, 4.0), 2)
        until = round(since + chance.choice(HELD), 2)
        wider = chance.choice(((block, behavior), (block, behavior), (block, ""), ("", "")))
        steered.append(Deed(since, "hold", block, behavior=behavior))
        steered.append(Deed(until, "continue", wider[0], behavior=wider[1]))
    last = max(deed.at for deed in steered)
    return tuple(sorted((*deeds, *steered, Deed(last, "continue", "")), key=lambda deed: deed.at))


def _faults(chance: Random) -> dict[str, Any]:
    """Deviations of the body, as the configuration spells them."""
    parts = ("head", "left_arm", "right_arm", "torso", "face")
    faults: dict[str, Any] = {"seed": chance.randrange(1000)}
    if chance.random() < 0.4:
        faults["noise"] = chance.choice((0.05, 0.1, 0.3))
    if chance.random() < 0.5:
        slow = {"part": chance.choice((*parts, "voice")), "factor": chance.choice((0.7, 1.5, 4.0))}
        faults["slow"] = [slow]
    if chance.random() < 0.4:
        before = chance.choice(("ready", "stroke", "stroke_end", "relax", "end"))
        faults["stall"] = [{"part": chance.choice(parts), "before": before}]
        if (seconds := chance.choice((0.5, 3.0, None))) is not None:
            faults["stall"][0]["seconds"] = seconds
    if chance.random() < 0.2:
        faults["displaced"] = [{"joint": "right_shoulder_pitch", "angle": 20.0}]
    if chance.random() < 0.2:
        faults["overheated"] = [chance.choice(parts)]
    if chance.random() < 0.15:
        faults["mute"] = chance.choice(("silent", "refuse"))
    if chance.random() < 0.2:
        faults["lost"] = 0.2
    return faults


def _lies(chance: Random) -> dict[str, Any]:
    """What goes wrong with the reports of the body, as `lying.Lies` has it."""
    lies: dict[str, Any] = {"seed": chance.randrange(1000)}
    for name in ("twice", "never", "mistimed", "foreign", "deaf", "refuse", "fail"):
        if chance.random() < 0.4:
            lies[name] = chance.choice((0.1, 0.3))
    if chance.random() < 0.25:
        lies["gone"] = round(chance.uniform(0.0, 4.0), 2)
        if chance.random() < 0.6:
            lies["back"] = round(lies["gone"] + chance.choice((0.3, 2.0, 8.0)), 2)
    return lies


# -- blocks ----------------------------------------------------------------------------------------------------------


def _dialect(chance: Random) -> str:
    return "draft" if chance.random() < 0.2 else "bml-1.0"


def _block(chance: Random, id: str, dialect: str, composition: str, others: Sequence[Made]) -> Made:
    elements: list[Element] = []
    for number in range(chance.choice((1, 2, 2, 3, 3, 4, 4, 5, 6))):
        type = chance.choices(tuple(WEIGHTS), tuple(WEIGHTS.values()))[0]
        elements.append(_element(chance, type, f"{type[0]}{'-' if chance.random() < 0.1 else ''}{number}", dialect))
    block = Made(id, dialect, composition, elements, [])
    for number, one in enumerate(elements):
        one.required = chance.random() < 0.08
        _time(chance, block, number, others)
    for _ in range(chance.choice((0, 0, 0, 1, 1, 2))):
        block.constraints.append(_constraint(chance, block, others))
    return block


def _element(chance: Random, type: str, id: str, dialect: str) -> Element:
    if type == "speech":
        return _speech(chance, id)
    is_draft = dialect == "draft"
    seven: tuple[str, ...] = reading.SEVEN if is_draft else reading.SEVEN_1_0
    points: tuple[str, ...]
    if type in reading.WITH_STROKE:
        points, main = seven, "stroke"
    elif type in reading.LASTING:
        main = "stroke" if is_draft else "ready" if type in ("gaze", "posture") else "attackPeak"
        points = seven if is_draft else ("start", main, "relax", "end")
    else:
        points, main = ("start", "end"), "end"
    attributes, inner = _CONTENT[type](chance)
    if type == "pointing" and is_draft:
        return Element("gesture", id, points, main, {"type": "POINT", **attributes})
    return Element(type, id, points, main, dict(attributes), inner)


def _speech(chance: Random, id: str) -> Element:
    words = chance.choice(SENTENCES).split()
    marks: list[str] = []
    text = escape(words[0])
    for number, word in enumerate(words[1:], 1):
        if chance.random() < 0.25:
            marks.append(f"m{number}")
            text += f' <sync id="m{number}"/>{escape(word)}'
        else:
            text += f" {escape(word)}"
    return Element("speech", id, ("start", *marks, "end"), "start", {}, f"<text>{text}</text>")


def _hand(chance: Random, *more: str) -> dict[str, str]:
    hand = chance.choice((*HANDS, *more))
    return {"mode": hand} if hand else {}


def _looked_at(chance: Random) -> dict[str, str]:
    target = "ghost" if chance.random() < 0.02 else chance.choice(TARGETS)
    return {"target": target}


def _nodded(chance: Random) -> dict[str, str]:
    said = {"lexeme": chance.choice(("NOD", "NOD", "SHAKE"))}
    if chance.random() < 0.4:
        said["repetition"] = str(chance.randint(1, 3))
    if chance.random() < 0.3:
        said["amount"] = chance.choice(("0.3", "0.8", "1"))
    return said


Content = tuple[Mapping[str, str], str]
_CONTENT: Mapping[str, Callable[[Random], Content]] = {
    "gaze": lambda chance: (_looked_at(chance), ""),
    "gazeShift": lambda chance: (_looked_at(chance), ""),
    "headDirectionShift": lambda chance: (_looked_at(chance), ""),
    "pointing": lambda chance: ({"target": chance.choice(TARGETS[:3]), **_hand(chance)}, ""),
    "gesture": lambda chance: (
        {"lexeme": chance.choice(("BEAT", "BEAT", "WAVE")), **_hand(chance, "BOTH_HANDS")},
        "",
    ),
    "head": lambda chance: (_nodded(chance), ""),
    "face": lambda chance: ({"amount": "0.8"}, f'<lexeme lexeme="{chance.choice(LEXEMES)}"/>'),
    "faceLexeme": lambda chance: ({"lexeme": chance.choice(LEXEMES), "amount": chance.choice(("0.5", "1"))}, ""),
    "faceFacs": lambda chance: ({"au": chance.choice(("1", "4", "12")), "amount": "0.7"}, ""),
    "faceShift": lambda chance: ({"amount": "0.6"}, f'<lexeme lexeme="{chance.choice(LEXEMES)}"/>'),
    "posture": lambda chance: ({}, f'<pose part="WHOLEBODY" lexeme="{chance.choice(POSES)}"/>'),
    "postureShift": lambda chance: ({}, f'<pose part="WHOLEBODY" lexeme="{chance.choice(POSES)}"/>'),
    "wait": lambda chance: ({"duration": str(chance.choice((0.3, 1.0, 2.0)))}, ""),
    "emit": lambda chance: ({"event": "something"}, ""),
}


# -- timing ----------------------------------------------------------------------------------------------------------


def _time(chance: Random, block: Made, number: int, others: Sequence[Made]) -> None:
    """Write sync points at a behavior itself, or not."""
    one = block.elements[number]
    drawn = chance.random()
    if drawn < 0.38:
        return
    if drawn < 0.72:
        one.attributes[chance.choice(("start", "start", one.main))] = _ref(chance, block, number, others)
    elif drawn < 0.86:
        one.attributes[chance.choice(_inline(one))] = _ref(chance, block, number, others)
    elif drawn < 0.93:
        begin = round(chance.uniform(0.0, 2.0), 1)
        one.attributes["start"] = str(begin)
        one.attributes["end"] = str(round(begin + chance.uniform(0.5, 5.0), 1))
    else:
        points = _inline(one)
        first, last = sorted(chance.sample(range(len(points)), 2))
        one.attributes[points[first]] = _ref(chance, block, number, others)
        one.attributes[points[last]] = _later(chance, block, number, others)


def _inline(one: Element) -> tuple[str, ...]:
    """Points that can stand at the behavior itself: all but marks."""
    return ("start", "end") if one.tag == "speech" else one.points


def _later(chance: Random, block: Made, number: int, others: Sequence[Made]) -> str:
    """A time late enough for most that began before, or any point."""
    return str(round(chance.uniform(2.0, 6.0), 1)) if chance.random() < 0.6 else _ref(chance, block, number, others)


def _ref(chance: Random, block: Made, number: int, others: Sequence[Made]) -> str:
    """A time, or a point of another behavior: an earlier one, mostly."""
    if others and chance.random() < 0.25:
        return _abroad(chance, others)
    choice = [each for each in block.elements[:number] if each is not block.elements[number]]
    if chance.random() < 0.15:
        choice = [each for each in block.elements if each is not block.elements[number]]
    if not choice or chance.random() < 0.3:
        return str(round(chance.uniform(0.0, 4.0), 1))
    other = chance.choice(choice)
    sync = chance.choice((other.main, "start", "end", chance.choice(other.points)))
    return offset(chance, f"{other.id}:{sync}")


def _abroad(chance: Random, others: Sequence[Made]) -> str:
    other = chance.choice(others)
    if chance.random() < 0.25:
        return offset(chance, f"{other.id}:bml:{chance.choice(('end', 'end', 'start'))}")
    one = chance.choice(other.elements)
    return offset(chance, f"{other.id}:{one.id}:{chance.choice((one.main, 'end', chance.choice(one.points)))}")


def _constraint(chance: Random, block: Made, others: Sequence[Made]) -> str:
    left = list(block.elements)
    chance.shuffle(left)

    def ref() -> str:
        """A point of a behavior that is not named yet, as long as there is one."""
        one = left.pop() if left else chance.choice(block.elements)
        sync = chance.choice((one.main, one.main, chance.choice(one.points)))
        if one.tag == "head" and sync == "stroke" and chance.random() < 0.15:
            sync = "stroke:2"
        return offset(chance, f"{one.id}:{sync}")

    operator = chance.choice(("synchronize", "synchronize", "after", "before"))
    count = chance.choice((1, 1, 2, 3)) if operator == "synchronize" else chance.choice((1, 1, 2))
    count = max(1, min(count, len(left) - 1))
    first = _abroad(chance, others) if others and chance.random() < 0.3 else ref()
    syncs = "".join(f'<sync ref="{ref()}"/>' for _ in range(count))
    if operator == "synchronize" and chance.random() < 0.2:
        content = f'<synchronize><sync ref="{first}"/>{syncs}</synchronize>'
    else:
        content = f'<{operator} ref="{first}">{syncs}</{operator}>'
    if chance.random() < 0.1:
        return f"<required><constraint>{content}</constraint></required>"
    return f"<constraint>{content}</constraint>"
