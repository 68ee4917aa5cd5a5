"""Reading of the sentence about points that wait for each other in a circle: each step as two points and seconds."""

import re
from math import inf

UNSAID = inf
"""Seconds of a step of which it is not said how long it takes."""
STEPS = (
    (r"(?P<behavior>\S+) takes (?P<seconds>\S+) s from (?P<since>.+) to (?P<to>.+)", 1),
    (r"(?P<behavior>\S+) takes at most (?P<seconds>\S+) s from (?P<to>.+) to (?P<since>.+)", -1),
    (r"(?P<to>.+) is (at least )?(?P<seconds>\S+) s after (?P<since>.+)", 1),
    (r"(?P<since>.+) is at most (?P<seconds>\S+) s after (?P<to>.+)", -1),
    (r"(?P<to>.+) is not before (?P<since>.+)", 1),
    (r"(?P<since>.+) is not after (?P<to>.+)", -1),
)
"""Forms of a step, and the sign of its seconds: `to` is no earlier than `since` and so many seconds."""

Step = tuple[tuple[str, ...], tuple[str, ...], float]


def read(sentence: str) -> list[Step]:
    """Each step as the names of its instants, and seconds. An upper limit in the form `is` may go both ways."""
    return [_step(each) for each in sentence.split(", ")]


def _step(text: str) -> Step:
    for form, sign in STEPS:
        if (found := re.fullmatch(form, text)) and not (sign > 0 and " at most " in text):
            names = found.groupdict()
            since, to = (tuple(names[end].split(" = ")) for end in ("since", "to"))
            return since, to, sign * float(names.get("seconds") or 0.0)
    if found := re.fullmatch(r"(?P<to>\S+ (?:start|end)s) when (?P<since>\S+ (?:start|end)s)", text):
        since, to = ((found[end][:-1].replace(" ", ":"),) for end in ("since", "to"))
        return since, to, 0.0
    raise AssertionError(f"not a step: {text!r}")


def closed(steps: list[Step]) -> list[Step]:
    """The steps, each from where the one before it ended: an equality that is read backwards is turned round."""
    if len(steps) > 1 and steps[0][1] not in (steps[1][0], steps[1][1]):
        steps = [_turned(steps[0]), *steps[1:]]
    found = [steps[0]]
    for step in steps[1:]:
        found.append(step if step[0] == found[-1][1] else _turned(step))
        assert found[-1][0] == found[-2][1], steps
    assert found[-1][1] == found[0][0], steps
    return found


def closed_by_behaviors(steps: list[Step]) -> list[Step]:
    """The steps, with those that need no words: from a point of a behavior to a later one of it."""
    found = []
    for step, following in zip(steps, [*steps[1:], *steps[:1]], strict=True):
        found.append(step)
        if step[1] != following[0]:
            owners = [{each.partition(":")[0] for each in names} for names in (step[1], following[0])]
            assert set.intersection(*owners), steps
            found.append((step[1], following[0], UNSAID))
    return found


def _turned(step: Step) -> Step:
    since, to, seconds = step
    return to, since, -seconds
