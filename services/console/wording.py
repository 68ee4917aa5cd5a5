"""How the console says things: one spelling for the live view, the log and the tally."""

from collections.abc import Sequence

from engage_hri.schemas.attention import Claim
from engage_hri.schemas.behaviors import Action, EventKind
from engage_hri.schemas.feedback import WarningFeedback
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds

KINDS: dict[EventKind, str] = {
    "directed_gaze": "directed gaze",
    "mutual_facial_gaze": "mutual facial gaze",
    "adjacency_pair": "adjacency pair",
    "backchannel": "backchannel",
}
"""Event kinds as people write them, in the order of the tables."""


def seconds(value: Seconds | None, sign: bool = False) -> str:
    """`1.24 s`, with `+` or `-` if asked; `-` for None."""
    if value is None:
        return "-"
    return f"{number(value, sign)} s"


def number(value: Seconds | None, sign: bool = False) -> str:
    """The same without the unit, for tables that name it once."""
    if value is None:
        return "-"
    text = f"{value:{'+' if sign else ''}.2f}"
    return text[1:] if text in ("-0.00", "+0.00") else text


def clock(value: Seconds) -> str:
    """`1:23.4` since the view began."""
    minutes, rest = divmod(max(0.0, value), 60)
    return f"{int(minutes)}:{rest:04.1f}"


VERBS: dict[Action, tuple[str, str]] = {
    "look": ("looks", "at "),
    "point": ("points", "at "),
    "nod": ("nods", "to "),
    "shake": ("shakes the head", "to "),
    "speak": ("speaks", "to "),
    "act": ("moves", ""),
}


def deed(action: Action, targets: Sequence[str], robot: str) -> tuple[str, str]:
    """What someone does, and at, to or with what: `looks`, `at the robot`. An actor's id as a target means its face.

    A look without targets is a look away; other actions may have none.
    """
    verb, preposition = VERBS[action]
    if not targets:
        return verb, "away" if action == "look" else ""
    return verb, preposition + " and ".join("the robot" if target == robot else target for target in targets)


def decision(event: ConnectionEvent) -> str:
    """`succeeded 0.42 s`, `waiting`, `failed (optional)`..."""
    if event.state == "started":
        text = "waiting"
    elif event.state in ("succeeded", "failed", "completed") and event.delay is not None:
        text = f"{event.state} {seconds(event.delay)}"
    else:
        text = event.state
    return f"{text} (optional)" if event.optional and event.state == "failed" else text


def warning(message: WarningFeedback) -> str:
    """`! NO_SUCH_TARGET block:behavior: what is wrong`."""
    place = ":".join(part for part in (message.block, message.behavior) if part)
    return f"! {message.kind} {place}: {message.message}"


def statistics(statistics: Statistics) -> str:
    """`anna: engaged 0.92; 12 events, MTBCE 5.31 s`; the reasons, too, if it is less than engaged."""
    engagement = f"{statistics.level} {number(statistics.engagement)}" if statistics.engagement is not None else "-"
    reasons = f" ({'; '.join(statistics.reasons)})" if statistics.reasons and statistics.level != "engaged" else ""
    count = statistics.session.events
    events = f"{count} event{'' if count == 1 else 's'}, MTBCE {seconds(statistics.session.mtbce)}"
    return f"{statistics.actor or 'all'}: {engagement}{reasons}; {events}"


def claim(claim: Claim) -> str:
    """`fragment: rectangle (turn-3)`."""
    text = f"{claim.kind}: {claim.target}" if claim.target else claim.kind
    return f"{text} ({claim.reason})" if claim.reason else text


def names(ids: Sequence[str]) -> str:
    return ", ".join(ids)
