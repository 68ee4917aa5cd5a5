"""Words, times and numbers for the live view, the log, the tally and the page, so that all say the same.

Looks, pointings, nods and speech are seen as actions (schemas/perception.py), whoever asks for them. Of all else that
the robot performs - gestures by name, faces, postures, turns of the head - only those know the names who have the
block: `deeds` makes words of it.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import TYPES, dialect_sync, same_instant
from engage_hri.schemas.blocks import Block, Hold, WarningFeedback
from engage_hri.schemas.fragments import Claim, TurnFragment
from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.recognition import (
    ConnectionEvent,
    Floor,
    HeadHabit,
    Interjection,
    InterjectionReading,
    Statistics,
)
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.vocabulary import normal

SEEN: Seconds = 0.005
"""Error of a delay from which on it changes the two digits that are shown."""


def seconds(value: Seconds | None, sign: bool = False) -> str:
    """Write seconds as `1.24 s`, with `+` or `-` if asked; `-` for None."""
    return "-" if value is None else f"{number(value, sign)} s"


def number(value: Seconds | None, sign: bool = False) -> str:
    """Write seconds without the unit, for tables that name it once; `-` for None."""
    if value is None:
        return "-"
    text = f"{value:{'+' if sign else ''}.2f}"
    return text[1:] if text in ("-0.00", "+0.00") else text


def clock(value: Seconds) -> str:
    """Write seconds since the view began as `1:23.4`."""
    minutes, rest = divmod(round(max(0.0, value), 1), 60)
    return f"{int(minutes)}:{rest:04.1f}"


def together(names: Sequence[str], *, one_of: bool) -> str:
    """Names of several things: `blue-square and rectangle`; where it is one of them, `blue-square or rectangle`."""
    *first, last = names
    return f"{', '.join(first)} {'or' if one_of else 'and'} {last}" if first else last


def action_words(action: of.Action, targets: Sequence[str], robot: str, *, one_of: bool = False) -> tuple[str, str]:
    """Words for an action and its targets: `looks`, `at the robot`. one_of: it is at one of these.

    A look without targets is a look away; other actions without targets have no words for them.
    """
    verb, preposition = of.ACTIONS[action]
    if not targets:
        return verb, "away" if action == "look" else ""
    names = ["the robot" if target == robot else target for target in targets]
    return verb, preposition + together(names, one_of=one_of)


def decision(event: ConnectionEvent) -> str:
    """Words for the state of an event: `succeeded 0.42 s`, `waiting`, `failed (optional)`..."""
    if event.state == "started":
        text = "waiting"
    elif event.state in ("succeeded", "failed", "completed") and event.delay is not None:
        text = f"{event.state} {seconds(event.delay)}{_give_or_take(event.delay_error)}"
    else:
        text = event.state
    return f"{text} (optional)" if event.optional and event.state == "failed" else text


def _give_or_take(error: Seconds | None) -> str:
    """Write the error of a delay, if clocks of several machines make it large enough to be seen."""
    if error is None:
        return " (clocks not measured yet)"
    return f" ± {seconds(error)}" if error >= SEEN else ""


SAME_SPEECH: Seconds = 0.5
"""Seconds by which a recognizer may hear a speech begin at another time than a voice detector. Ours."""
READINGS: dict[InterjectionReading, str] = {
    "open": "not decided yet",
    "backchannel": "as a listener",
    "interruption": "takes the floor",
    "answer": "as an answer",
    "noise": "without words",
    "other": "to somebody else",
}


def interjection(message: Interjection) -> str:
    """Words for what a person says into the robot's turn: `ann, into the turn: "wait" (takes the floor)`."""
    words = f'"{message.words}" ' if message.words else ""
    return f"{message.actor}, into the turn: {words}({READINGS[message.reading]})"


def addressed(said: Utterance, floor: Floor | None, robot: str) -> str:
    """Words for who says something, and to whom if not to the robot alone: `ann (to ben)`. floor: as told last."""
    speeches = () if floor is None else (*floor.speeches, *floor.ended)
    own = [each for each in speeches if each.actor == said.actor and each.since.clock == said.began.clock]
    apart = [abs(each.since.seconds - said.began.seconds) for each in own]
    is_known = bool(apart) and min(apart) < SAME_SPEECH
    to = own[apart.index(min(apart))].to if is_known else said.to
    others = " and ".join("the robot" if each == robot else each for each in to)
    return said.actor if set(to) <= {robot} else f"{said.actor} (to {others})"


def floor(message: Floor, robot: str) -> str:
    """Words for those who speak at once: `at once: ann (to the robot), ben`; empty if fewer than two speak."""
    if len(message.speeches) < 2:
        return ""
    speakers = []
    for speech in message.speeches:
        to = " and ".join("the robot" if each == robot else each for each in speech.to)
        who = "the robot" if speech.actor == robot else speech.actor
        speakers.append(f"{who} (to {to})" if to else who)
    return f"at once: {', '.join(speakers)}"


def warning(message: WarningFeedback) -> str:
    """Write a warning as `! NO_SUCH_TARGET block:behavior: what is wrong`, or without a place if it has none."""
    return f"! {' '.join(filter(None, (message.kind, message.place)))}: {message.message}"


def statistics(statistics: Statistics) -> str:
    """Write `anna: engaged 0.92; 12 events, MTBCE 5.31 s`, with the reasons if the level is less than engaged.

    Behind it, how the head points of a person of whom that is known: `; head 2.1 degrees left, 4.0 down of ...`.
    """
    engagement = f"{statistics.level} {number(statistics.engagement)}" if statistics.engagement is not None else "-"
    reasons = f" ({'; '.join(statistics.reasons)})" if statistics.reasons and statistics.level != "engaged" else ""
    count = statistics.session.events
    events = f"{count} event{'' if count == 1 else 's'}, MTBCE {seconds(statistics.session.mtbce)}"
    return f"{statistics.actor or 'all'}: {engagement}{reasons}; {events}{_head(statistics.head)}"


def _head(head: HeadHabit | None) -> str:
    """Write where a head points whose person looks at the robot, and from how many looks that is known."""
    if head is None:
        return ""
    left, up = -head.offset[0], -head.offset[1]
    aside = f"{abs(left):.1f} degrees {'left' if left > 0 else 'right'}"
    above = f"{abs(up):.1f} {'up' if up > 0 else 'down'}"
    count = len(head.looks)
    return f"; head {aside}, {above} of what is looked at, by {count} look{'' if count == 1 else 's'}"


def held(hold: Hold) -> str:
    """Name what a hold holds: `everything`, `block b`, or `b: wave`."""
    if not hold.block:
        return "everything"
    return f"{hold.block}: {hold.behavior}" if hold.behavior else f"block {hold.block}"


def claim(claim: Claim) -> str:
    """Write a claim as `fragment: rectangle (turn-3)`."""
    text = f"{claim.kind}: {claim.target}" if claim.target else claim.kind
    return f"{text} ({claim.reason})" if claim.reason else text


ACTIONS = ("NOD", "SHAKE")
"""Movements of the head of which actions tell."""

LACKS, NEAR = "this body has no", ", as near as it can"
"""Words of a warning of the body that performs something near, which it names itself, and those for the deed."""
HANDS: Mapping[of.Hand, str] = {
    "LEFT_HAND": " with the left hand", "RIGHT_HAND": " with the right hand", "BOTH_HANDS": " with both hands",
}  # fmt: skip


class Deed(NamedTuple):
    """Words for what the robot does in a behavior. sync: when it is seen, in the spelling of the block's dialect."""

    sync: str
    words: str

    def as_warned(self, warning: str) -> "Deed":
        """Tell that the body does only something near to it. warning: of kind DEGRADED, which says what it lacks."""
        return self._replace(words=f"{self.words}{NEAR}") if LACKS in warning else self


def deeds(thing: Block | TurnFragment) -> dict[tuple[str, str], Deed]:
    """List what is performed besides actions, by block and behavior. The block of a fragment has its id."""
    dialect = thing.dialect if isinstance(thing, Block) else "draft"
    found = {}
    for behavior in thing.behaviors:
        if words := _words(behavior):
            type = type_name(behavior)
            row = TYPES[type]
            seen = "stroke_start" if row.has_stroke else "stroke" if "stroke" in row.points else row.points[-1]
            sync = dialect_sync(same_instant(seen, type), type, dialect)
            found[thing.id, behavior.id] = Deed(sync or seen, words)
    return found


def _words(behavior: of.Behavior) -> str:
    """Say what the robot does; empty: actions tell of it, or there is nothing to see."""
    match behavior:
        case of.Gesture(lexeme=lexeme, mode=mode):
            return f"makes the gesture {lexeme}{HANDS[mode] if mode else ''}"
        case of.Head(lexeme=lexeme) if normal(lexeme) not in ACTIONS:
            return f"moves the head: {lexeme}"
        case of.Face() | of.FaceLexeme() | of.FaceFacs() | of.FaceShift():
            shown = " and ".join(filter(None, map(_expression, of.expressed(behavior))))
            return f"shows the face {shown}" if shown else ""
        case of.Posture() | of.PostureShift():
            poses = [" ".join(filter(None, (each.lexeme, each.part))) for each in of.posed(behavior)]
            taken = " and ".join(filter(None, (behavior.stance, *poses)))
            return f"takes the posture {taken}" if taken else ""
        case of.Pose(lexeme=lexeme, part=part):
            return f"takes the pose {' '.join(filter(None, (lexeme, part)))}"
        case of.Gaze() | of.GazeShift() if behavior.offset_angle:
            direction = f" {behavior.offset_direction}" if behavior.offset_direction else ""
            return f"looks {behavior.offset_angle:g}°{direction} of {behavior.target}"
        case of.Locomotion(target=target):
            return f"moves to {target}"
    return ""


def _expression(shown: of.Expression) -> str:
    name = shown.lexeme or (f"AU {shown.au}" if shown.au else "")
    return f"{name} {shown.side.lower()}" if name and shown.side != "BOTH" else name
