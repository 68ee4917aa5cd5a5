"""Words for the live view, the log and the tally, so that all say the same."""

from collections.abc import Sequence

from engage_hri.schemas.behaviors import Action, EventKind
from engage_hri.schemas.blocks import Hold, WarningFeedback
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds

KINDS: dict[EventKind, str] = {
    "directed_gaze": "directed gaze",
    "mutual_facial_gaze": "mutual facial gaze",
    "adjacency_pair": "adjacency pair",
    "backchannel": "backchannel",
}
"""Event kinds as people write them, in the order of the tables."""

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


def action_words(action: Action, targets: Sequence[str], robot: str) -> tuple[str, str]:
    """Words for an action and its targets: `looks`, `at the robot`.

    A look without targets is a look away; other actions without targets have no words for them.
    """
    verb, preposition = VERBS[action]
    if not targets:
        return verb, "away" if action == "look" else ""
    return verb, preposition + " and ".join("the robot" if target == robot else target for target in targets)


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


def warning(message: WarningFeedback) -> str:
    """Write a warning as `! NO_SUCH_TARGET block:behavior: what is wrong`, or without a place if it has none."""
    return f"! {' '.join(filter(None, (message.kind, message.place)))}: {message.message}"


def statistics(statistics: Statistics) -> str:
    """Write `anna: engaged 0.92; 12 events, MTBCE 5.31 s`, with the reasons if the level is less than engaged."""
    engagement = f"{statistics.level} {number(statistics.engagement)}" if statistics.engagement is not None else "-"
    reasons = f" ({'; '.join(statistics.reasons)})" if statistics.reasons and statistics.level != "engaged" else ""
    count = statistics.session.events
    events = f"{count} event{'' if count == 1 else 's'}, MTBCE {seconds(statistics.session.mtbce)}"
    return f"{statistics.actor or 'all'}: {engagement}{reasons}; {events}"


def held(hold: Hold) -> str:
    """Name what a hold holds: `everything`, `block b`, or `b: wave`."""
    if not hold.block:
        return "everything"
    return f"{hold.block}: {hold.behavior}" if hold.behavior else f"block {hold.block}"


def claim(claim: Claim) -> str:
    """Write a claim as `fragment: rectangle (turn-3)`."""
    text = f"{claim.kind}: {claim.target}" if claim.target else claim.kind
    return f"{text} ({claim.reason})" if claim.reason else text
