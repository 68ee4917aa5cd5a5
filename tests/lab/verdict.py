"""What the records of processes say of a run in which something broke. Pure: it reads events, and nothing of ours."""

from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

Event = Mapping[str, Any]
"""A line of a record (recorded.py): `t`, `process`, `what`, and more."""
Seconds = float
NO_END = ("Accepted", "Refused")
"""Answers that are no outcome: one life of a server may refuse what another has performed."""


class Span(NamedTuple):
    """Times between which a fault lasted. began: when it was put in force. healed: when it was over."""

    began: Seconds
    healed: Seconds


class Motion(NamedTuple):
    """How the body took a fault, in seconds after it began; None: it did not come to that.

    held: it told that it holds. quiet: the last word's end. still: no joint moved.
    """

    held: Seconds | None
    quiet: Seconds | None
    still: Seconds | None


PERSON = "human"
"""The person of whom the simulation tells."""


class Injury(NamedTuple):
    """What a fault did to whom. kind: of faults.py. far: participants behind a cut, if it is one.

    injured: participants that it hit, as others see them; also "router". began, over: when all was whole again.
    """

    kind: str
    injured: frozenset[str]
    began: Seconds
    over: Seconds


class Links(NamedTuple):
    """Times in which services had no router, as their own links reported it, and when requests were made."""

    gone: Mapping[str, Sequence[Span]]
    asked: Mapping[str, Seconds]

    @staticmethod
    def of(events: Iterable[Event]) -> "Links":
        gone, asked, since = defaultdict[str, list[Span]](list), dict[str, Seconds](), dict[str, Seconds]()
        for each in events:
            if each["what"] == "unlinked":
                since.setdefault(each["service"], each["t"])
            elif each["what"] in ("linked", "began") and each["service"] in since:
                gone[each["service"]].append(Span(since.pop(each["service"]), each["t"]))
            elif each["what"] == "asked":
                asked.setdefault(each["whose"], each["t"])
        for service, at in since.items():
            gone[service].append(Span(at, float("inf")))
        return Links(gone, asked)

    def were_lost(self, end: Event, injuries: Sequence[Injury], after: Seconds) -> bool:
        """True if who says so had no router while this was asked for, or lately, and a fault had taken that away.

        A request of long ago may wait for as long as its server takes patience: it ends for what was then.
        """
        since = min(self.asked.get(end["whose"], end["t"]), end["t"] - after)
        return any(
            span.began <= end["t"] and since <= span.healed and each.began <= span.healed and span.began <= each.over
            for span in self.gone.get(end["speaker"], ())
            for each in injuries
            if "router" in each.injured
        )


TRUE_CAUSES: Mapping[str, frozenset[str]] = {
    "kill": frozenset(("restarted", "gone", "silent", "unrenewed", "forgotten", "late")),
    "freeze": frozenset(("frozen", "gone", "silent", "unrenewed", "late")),
    "cut": frozenset(("gone", "silent", "unrenewed", "late", "unlinked")),
    "reboot": frozenset(("restarted", "gone", "silent", "unrenewed", "forgotten", "late")),
    "clock": frozenset(("restarted", "gone", "silent", "unrenewed", "forgotten", "late")),
    "router": frozenset(("unlinked",)),
}
"""What can truly be said of a service, or of the router, after each kind of fault."""
CONTENT = {
    "the world has no ": ("simulation", "control"), "the world does not know ": ("simulation",),
    "$.turn_status: ": ("collaboration", "generation"), " of this id goes on": ("collaboration",),
    "out of reach where the torso is now": ("realizer", "control"),  # it was planned before the body went home
}  # fmt: skip
"""Refusals of what was asked, by their words, and who must have been hit: else it would not ask for that."""
REMEMBERED: Seconds = 20.0
"""Seconds after everything is whole again in which something is refused for what was before, as an open turn is."""
BY_SOMEBODY = frozenset(("cancelled", "replaced", "closed"))
"""Causes that are deeds of a participant, not of a machine."""
NOT_DONE = ("failed", "interrupted", "unknown", "refused", "lapsed", "aborted", "taken_over", "Refused")
"""Ends other than done. To who had asked, one is told as an exception, too: `RunFailed: ...`."""


def untrue(events: Iterable[Event], injuries: Sequence[Injury], after: Seconds) -> list[str]:
    """Ends other than done, of whatever request and as whoever knows them, that give no true cause.

    after: seconds after everything is whole again in which an end still comes of a fault. Of a router that was gone
    it comes as long as what was asked for meanwhile goes on: whoever says so must have lost its own link to it.
    """
    events = list(events)
    links = Links.of(events)
    return [
        f"{each.get('status') or each.get('told')} of {each['whose']} at {each['t']:.2f} in {each['service']}: {why}"
        for each in events
        if each["what"] in ("answer", "told") and is_not_done(each) and (why := _flaw(each, injuries, links, after))
    ]


def is_not_done(end: Event) -> bool:
    how = end.get("status") or end.get("told") or ""
    return how in NOT_DONE or ": " in how


def _flaw(end: Event, injuries: Sequence[Injury], links: Links, after: Seconds) -> str:
    cause, blamed = end["cause"], end["blamed"]
    if not end["reason"] or not end["speaker"]:
        return f"names no cause ({end['reason'] or 'nothing is said'}), or nobody who says it"
    if cause in BY_SOMEBODY:
        return "" if blamed else f"{cause}, but not by whom"
    now = [each for each in injuries if each.injured and each.began <= end["t"] <= each.over + after]
    if not cause:  # nothing has happened, it says: the service itself refused, or could not
        before = [each for each in injuries if each.began <= end["t"] <= each.over + REMEMBERED]
        hit = {name for words, names in CONTENT.items() if words in end["reason"] for name in names}
        if not now or any(hit & each.injured for each in before):
            return ""
        return f"no cause, while {', '.join(each.kind for each in now)}: {end['reason']}"
    if (cause, blamed) == ("unlinked", "router"):
        is_refused = "Refused" in (end.get("status") or end.get("told") or "")
        if links.were_lost(end, injuries, REMEMBERED if is_refused else after):
            return ""
        return f"unlinked, says {end['speaker']}, whose link to the router was whole: {end['reason']}"
    is_unseen = blamed == PERSON and cause == "gone"  # and nobody can know more of a person
    if any(blamed in each.injured and (is_unseen or cause in TRUE_CAUSES[each.kind]) for each in now):
        return ""
    known = "; ".join(f"{each.kind} of {', '.join(sorted(each.injured))}" for each in now) or "nothing"
    return f"{cause} of {blamed}, says {end['speaker']}, but what happened was {known}: {end['reason']}"


def spoken_twice(events: Iterable[Event], manager: str) -> list[str]:
    """Words that were said more than once for one life of the manager. A new one asks for all of it anew."""
    said, life = Counter[tuple[str, str, str, int]](), ""
    for each in events:
        if each["what"] == "asked" and each["service"] == manager:
            life = each["process"]
        elif each["what"] == "word":
            said[life, each["block"], each["behavior"], each["position"]] += 1
    return [
        f"{block}:{behavior} at {position}" for (_, block, behavior, position), times in said.items() if times > 1
    ]


def doubled(events: Iterable[Event]) -> list[str]:
    """Requests with two different outcomes."""
    ends = defaultdict[str, set[str]](set)
    for each in events:
        if each["what"] == "answer" and each["status"] not in NO_END:
            ends[each["whose"]].add(each["status"])
    return [f"{whose}: {', '.join(sorted(told))}" for whose, told in ends.items() if len(told) > 1]


def unanswered(events: Iterable[Event], living: Collection[str], before: Seconds) -> list[str]:
    """Requests of living processes that were made before some time and of which the caller knows no end yet."""
    asked = dict[tuple[str, str], Seconds]()
    for each in events:
        if each["what"] == "asked" and each["process"] in living:
            asked[each["process"], each["whose"]] = each["t"]
        elif each["what"] == "told":
            asked.pop((each["process"], each["whose"]), None)
    return [whose for (_, whose), at in asked.items() if at < before]


def calm_ago(now: Seconds, faults: Sequence[Span], seconds: Seconds) -> Seconds:
    """The time since which so many seconds have passed with nothing broken: a request waits for its server."""
    at, left = now, seconds
    for span in reversed(faults):
        if (calm := max(0.0, at - span.healed)) >= left:
            break
        at, left = span.began, left - calm
    return at - left


def sees(events: Iterable[Event], process: str) -> dict[str, Seconds]:
    """Participants that a process sees after these events, and since when."""
    seen = dict[str, Seconds]()
    for each in events:
        if each["process"] == process and each["what"] in ("sees", "misses"):
            if each["what"] == "misses":
                seen.pop(each["name"], None)
            else:
                seen.setdefault(each["name"], each["t"])
    return seen


def performed_at(events: Iterable[Event], control: str, at: Seconds) -> set[str]:
    """Behaviors, by their requests, that the body performed at some time."""
    live = set[str]()
    for each in events:
        is_its = each["process"] == control and each["what"] == "answer" and each["t"] <= at
        if is_its and "|perform_behavior|" in each["whose"]:
            (live.add if each["status"] == "Accepted" else live.discard)(each["whose"])
    return live


def motion(events: Sequence[Event], control: str, span: Span) -> Motion:
    """How the body took a fault, while it lasted."""
    its = [each for each in events if each["process"] == control and span.began <= each["t"] <= span.healed]
    live = {whose.rpartition("/")[2] for whose in performed_at(events, control, span.began)}
    holds = (each for each in its if each["what"] == "held" and live & set(map(_behavior, each["behaviors"])))
    held = next((each["t"] for each in holds), None)
    until = next((each["t"] for each in its if held and each["t"] > held and _goes_on(each)), None) or span.healed
    quiet = [each["at"] for each in its if each["what"] == "word" and each["t"] < until]
    still = [each["since"] for each in its if each["what"] == "still" and each["t"] < until]
    return Motion(
        None if held is None else held - span.began,
        max(quiet) - span.began if quiet else None,
        max(0.0, max(still) - span.began) if still else None,
    )


def _behavior(label: str) -> str:
    return label.partition(":")[2]


def _goes_on(event: Event) -> bool:
    return bool(event["what"] == "held" and not event["behaviors"])


def unheld(events: Sequence[Event], control: str, span: Span, within: Seconds) -> list[str]:
    """Behaviors that went on although they had to be held within so many seconds of the fault."""
    due = span.began + within
    if span.healed < due:
        return []
    going_on = performed_at(events, control, span.began) & performed_at(events, control, due)
    held = {
        _behavior(behavior)
        for each in events
        if each["process"] == control and each["what"] == "held" and span.began <= each["t"] <= due
        for behavior in each["behaviors"]
    }
    return [whose for whose in going_on if whose.rpartition("/")[2] not in held]


def groundless(events: Iterable[Event], faults: Collection[tuple[Seconds, Seconds]]) -> list[str]:
    """Holds that came while nothing was broken. faults: since when until when something was."""
    holds = [each for each in events if each["what"] == "held" and each["behaviors"]]
    calm = [each for each in holds if not any(since <= each["t"] <= to for since, to in faults)]
    return [f"{', '.join(each['behaviors'])} at {each['t']:.1f}" for each in calm]


def shares(values: Iterable[Seconds | None]) -> str:
    """The distribution of values: least, median, 90 %, 99 %, most."""
    known = sorted(each for each in values if each is not None)
    if not known:
        return "none"
    at = [known[min(len(known) - 1, round(share * (len(known) - 1)))] for share in (0.0, 0.5, 0.9, 0.99, 1.0)]
    return f"{len(known)}: " + " / ".join(f"{each:.2f}" for each in at) + " s"
