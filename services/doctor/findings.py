"""Findings: what is wrong, or may be, on a robot's bus and on this machine, and what to do. Pure: facts in."""

from collections.abc import Callable, Iterable, Iterator
from typing import Literal

from msgspec import Struct

from engage_hri.schemas import access, keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.keys import Part
from engage_hri.schemas.participants import ClockOffset, ProcessFacts, Status
from engage_hri.schemas.units import A_DAY, Seconds, span

# -- facts -----------------------------------------------------------------------------------------------------------


class EndpointFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """An endpoint at which the bus should be found, and whether somebody opens there.

    problem: why nobody does; empty: somebody does. is_local: only processes of this machine can reach it. is_closed:
    it is encrypted. until: end of the certificate that is shown there, in seconds since 1970.
    """

    endpoint: str
    problem: str = ""
    is_local: bool = True
    is_closed: bool = False
    until: int | None = None


class Certificate(Struct, frozen=True, kw_only=True):
    """A certificate in the folder of keys. until: its end, in seconds since 1970."""

    name: str
    until: int


class ParticipantFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A participant on the bus.

    part: as it shows itself. seen: it is seen from here. lives: number of processes that have its name. answers:
    whether it should answer questions for its status. status: its answer; None: none came in time. later: a second
    answer, a second later. trip: the quickest round trip from here to its process. wall: by how much its machine's
    wall clock is ahead of the one here.
    """

    name: str
    part: Part = "robot"
    seen: bool = True
    lives: int = 1
    answers: bool = True
    status: Status | None = None
    later: Status | None = None
    trip: Seconds | None = None
    wall: Seconds = 0.0


class BodyFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The robot's body. types: the types of behaviors that it performs. problem: why nothing is known of it."""

    name: str = ""
    types: tuple[str, ...] = ()
    problem: str = ""


class WorldFacts(Struct, frozen=True, kw_only=True):
    """The world as perception tells it. age: time since then."""

    source: str
    people: int
    objects: int
    age: Seconds


class SystemFacts(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Facts, as they were seen from this process.

    at: wall clock, in seconds since 1970. version: of Engage. own: this process. found: robots on the bus other than
    this one. protocols: versions of the protocol that are spoken there. clocks: those of other machines. bus: whether
    the bus could be opened. sight: `unknown` if these keys do not let us look.
    """

    robot: str
    at: float
    version: str
    protocol: str
    own: ProcessFacts
    services: tuple[str, ...]
    """Services that make up a robot."""
    doors: tuple[EndpointFacts, ...] = ()
    bus: bool = True
    problem: Fault | None = None
    """Reason why keys or bus cannot be used."""
    found: tuple[str, ...] = ()
    protocols: tuple[str, ...] = ()
    certificates: tuple[Certificate, ...] = ()
    known: tuple[ParticipantFacts, ...] = ()
    clocks: tuple[ClockOffset, ...] = ()
    body: BodyFacts | None = None
    sight: WorldFacts | Literal["unknown"] | None = None


HERE = "here"
"""Name of the row of this process."""
Sees = Literal["itself", "yes", "no", "needless", "unknown"]
"""needless: it does not see it, and has no need to."""


class Cell(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Tells whether `viewer` sees `other`. trip: the quickest round trip between their processes or machines."""

    viewer: str
    other: str
    sees: Sees
    trip: Seconds | None = None


def matrix(facts: SystemFacts) -> tuple[Cell, ...]:
    """Cells of the matrix, row by row: first this process, then all that answer for themselves."""
    return tuple(_cells(facts))


def _cells(facts: SystemFacts) -> Iterator[Cell]:
    for other in facts.known:
        yield Cell(viewer=HERE, other=other.name, sees="yes" if other.seen else "no", trip=other.trip)
    for viewer in facts.known:
        if not viewer.answers:
            continue
        for other in facts.known:
            sees: Sees
            trip = None
            if viewer.name == other.name:
                sees = "itself"
            elif viewer.status is None:
                sees = "unknown"
            else:
                hidden: Sees = "no" if _needs(viewer.name, other.part) else "needless"
                sees = "yes" if other.name in viewer.status.bus.peers else hidden
                if sees == "yes" and (clock := clock_of(viewer.status, other.status)) is not None:
                    trip = clock.trip
            yield Cell(viewer=viewer.name, other=other.name, sees=sees, trip=trip)


def _needs(viewer: str, part: keys.Part) -> bool:
    """True if one has to see participants of this part: everybody sees the robot, and services see their clients."""
    heard = access.rows(access.role_of(viewer), "subscribes")
    return part == "robot" or keys.alive("*", part) in heard


def clock_of(viewer: Status, other: Status | None) -> ClockOffset | None:
    """Measurement that one has of the other's clock; None: it has the same clock, or has not measured it."""
    if other is None:
        return None
    return next((each for each in viewer.bus.clocks if each.clock == other.at.clock), None)


Severity = Literal["wrong", "doubtful", "note"]
SOON = 30
"""Days before its end from which on a certificate is told."""
FAR: Seconds = 0.1
"""Round trip from which on a path is told to be slow: the body holds 0.5 s after the realizer's last word."""
STOOD: Seconds = 0.25
"""Time that messages waited for a process from which on it is told."""
WALL: Seconds = 2.0
"""Difference of wall clocks from which on it is told."""
PRECISE: Seconds = 0.005
"""Error of a clock from which on delays can be wrong by more than 10 ms."""


class Diagnosis(Struct, frozen=True, kw_only=True):
    """A finding.

    severity: wrong: something does not work; doubtful: it works, but not as well as it should; note: good to know.
    where: participant, endpoint, package or file. do: what to do about it.
    """

    severity: Severity
    where: str
    what: str
    do: str


def findings(facts: SystemFacts) -> tuple[Diagnosis, ...]:
    """All findings, the worst first, else in the order in which one would mend them."""
    order: tuple[Severity, ...] = ("wrong", "doubtful", "note")
    found = [finding for rule in RULES for finding in rule(facts)]
    return tuple(sorted(found, key=lambda finding: order.index(finding.severity)))


def _problem(facts: SystemFacts) -> Iterator[Diagnosis]:
    if (fault := facts.problem) is not None:
        yield Diagnosis(
            severity="wrong", where=fault.where or "bus", what=fault.reason,
            do=fault.advice or "see docs/security.md for keys, docs/deploy.md for endpoints",
        )  # fmt: skip


def _doors(facts: SystemFacts) -> Iterator[Diagnosis]:
    shut = [door for door in facts.doors if door.problem]
    for door in facts.doors:
        if door.problem:
            router = f"start `engage router --listen {door.endpoint}`"
            if door.is_local and not door.is_closed:
                do = f"`engage up --robot {facts.robot}` starts a robot here; one elsewhere takes --connect"
            elif door.is_local:
                do = f"{router} --keys ..., or name the router with --connect"
            else:
                do = f"there {router}; if it runs, look for another address, or for a firewall that shuts the port"
            yield Diagnosis(
                severity="doubtful" if len(shut) < len(facts.doors) else "wrong",
                where=door.endpoint, what=f"nobody opens: {door.problem}", do=do,
            )  # fmt: skip
        elif not door.is_local and not door.is_closed:
            yield Diagnosis(
                severity="doubtful", where=door.endpoint,
                what="open to all: whoever reaches this address can drive the robot",
                do="make keys, `engage keys init` (docs/security.md), unless the network is yours alone",
            )  # fmt: skip
    if facts.bus and facts.doors and not shut and not facts.known and not facts.found and facts.own.mode == "peer":
        yield Diagnosis(
            severity="note", where=facts.doors[0].endpoint, what="somebody listens there, and no participant shows",
            do="if no process of Engage has this port, set another one with --connect and --listen",
        )  # fmt: skip


def _services(facts: SystemFacts) -> Iterator[Diagnosis]:
    there = {one.name for one in facts.known}
    if not facts.bus:
        return
    if not there & set(facts.services):
        others = f"; there are: {', '.join(facts.found)}" if facts.found else ""
        yield Diagnosis(
            severity="wrong", where=facts.robot, what=f"no service of this robot is on the bus{others}",
            do=f"`engage up --robot {facts.robot}` starts one; or name another with --robot, --connect",
        )  # fmt: skip
    else:
        for name in facts.services:
            if name not in there:
                yield Diagnosis(
                    severity="wrong", where=name,
                    what="nobody sees this service: it has ended, stands still, or is cut off",
                    do=f"look for its process. If there is none, what it printed says why; start `engage run {name}`"
                    " with the same --robot and --connect. If it is stopped (state T in `ps`), `kill -CONT` lets it"
                    " go on. If it runs, look at its network, and whether its --connect names the same router",
                )  # fmt: skip
    for version in facts.protocols:
        if version != facts.protocol:
            yield Diagnosis(
                severity="wrong", where=facts.robot,
                what=f"somebody speaks {version}, which nobody hears who speaks {facts.protocol}",
                do="bring all machines to one version of Engage",
            )  # fmt: skip


def _sight_of_one_another(facts: SystemFacts) -> Iterator[Diagnosis]:
    by_name = {one.name: one for one in facts.known}
    hidden: dict[str, list[str]] = {}
    for cell in matrix(facts):
        if cell.sees == "no":
            hidden.setdefault(cell.other, []).append(cell.viewer)
    for name, viewers in hidden.items():
        why, do = _why_hidden(facts, by_name[name])
        yield Diagnosis(
            severity="wrong" if by_name[name].answers else "doubtful", where=name,
            what=f"it is there, but not seen by {_listed(viewers)}{why}", do=do,
        )  # fmt: skip


def _why_hidden(facts: SystemFacts, one: ParticipantFacts) -> tuple[str, str]:
    places = {
        place
        for other in facts.known
        if other.status is not None
        for reachable in other.status.bus.reachable
        if reachable.participant == one.name
        for place in reachable.endpoints
    }
    where = _listed(sorted({place.removesuffix(":0") for place in places}))  # 0: the system has chosen a port
    router = "let all connect to one router (`engage router`; docs/deploy.md)"
    if places and all(_is_loopback(place) for place in places):
        return (
            f": it listens on {where} only",
            f"{router}, or give it --listen with its own address",
        )
    if places:
        return (
            f": it listens on {where}, and the path there is cut",
            f"try from there whether {where} can be reached (network, firewall); or {router}, through which all go",
        )
    return (
        "",
        f"look whether both name the same router in --connect, and whether that router is linked to others; {router}",
    )


def _is_loopback(place: str) -> bool:
    host = place.partition("/")[2].rpartition(":")[0]
    return host in ("localhost", "[::1]") or host.startswith("127.")


def _answers(facts: SystemFacts) -> Iterator[Diagnosis]:
    for one in facts.known:
        status = one.status
        if one.lives > 1:
            yield Diagnosis(
                severity="wrong", where=one.name, what=f"{one.lives} processes have this name",
                do="stop all but one; robots on one bus need names of their own (--robot)",
            )  # fmt: skip
        if one.seen and one.answers and status is None:
            yield Diagnosis(
                severity="wrong", where=one.name, what="it is there, and does not answer",
                do="it hangs, is stopped, or its link is being cut: look at its log and load, and start it again",
            )  # fmt: skip
        elif status is not None and status.stands is None:
            yield Diagnosis(
                severity="doubtful", where=one.name, what="it does not serve yet", do="wait, and look at its log"
            )


def _versions(facts: SystemFacts) -> Iterator[Diagnosis]:
    answering = [one.status for one in facts.known if one.status is not None]
    for status in answering:
        process = status.process
        for what, theirs, ours in (
            ("Engage", status.version, facts.version),
            ("Zenoh", process.zenoh, facts.own.zenoh),
        ):
            if theirs and ours and theirs != ours:
                yield Diagnosis(
                    severity="doubtful", where=status.participant,
                    what=f"{what} {theirs} on {process.host or 'its machine'}, {ours} here",
                    do="install the same version on all machines",
                )  # fmt: skip


def _losses(facts: SystemFacts) -> Iterator[Diagnosis]:
    for one in facts.known:
        if one.status is None:
            continue
        for field, what, do, now, before in _COUNTS:
            number = getattr((one.later or one.status).bus, field)
            grows = number > getattr(one.status.bus, field)
            if number:
                yield Diagnosis(
                    severity=now if grows else before, where=one.name,
                    what=f"{what}: {number} since it came{', and more just now' if grows else ''}", do=do,
                )  # fmt: skip
        if (lag := (one.later or one.status).bus.lag) > STOOD:
            yield Diagnosis(
                severity="doubtful" if lag > one.status.bus.lag else "note", where=one.name,
                what=f"messages once waited {lag:.2f} s for this process",
                do="give it more of a processor; a body or client of your own must not keep the loop for long",
            )  # fmt: skip


_COUNTS: tuple[tuple[str, str, str, Severity, Severity], ...] = (
    ("failures", "errors that are bugs", "what it printed has the tracebacks: please report them", "wrong", "wrong"),
    ("lost", "messages lost for good", "look at the network between its machine and the others", "wrong", "doubtful"),
    (
        "refused", "messages that could not be read",
        "look on `engage watch --only faults` and in its log from whom they come: another version, or a stranger",
        "doubtful", "doubtful",
    ),
    (
        "overflowed", "messages dropped as nobody read them in time", "it is too slow for what it subscribes to",
        "doubtful", "doubtful",
    ),
    ("dropped", "messages dropped before its loop got to them", "give it more of a processor", "doubtful", "note"),
    ("gaps", "gaps, all of which were filled", "nothing, if paths were cut or it was busy", "doubtful", "note"),
)  # fmt: skip
"""Fields of `BusHealth`: what they count, what to do, and how bad that is while it grows and else."""


def _paths(facts: SystemFacts) -> Iterator[Diagnosis]:
    slow: dict[str, list[str]] = {}
    for cell in matrix(facts):
        if cell.trip is not None and cell.trip > FAR:
            slow.setdefault(cell.other, []).append(f"{cell.viewer} ({1000 * cell.trip:.0f} ms)")
    for name, viewers in slow.items():
        yield Diagnosis(
            severity="doubtful", where=name, what=f"round trips are long from {_listed(viewers)}",
            do="look at the network (Wi-Fi, load); the realizer belongs near the body",
        )  # fmt: skip


def _clocks(facts: SystemFacts) -> Iterator[Diagnosis]:
    statuses = [one.status for one in facts.known if one.status is not None]
    recognition = next((status for status in statuses if status.participant == "recognition"), None)
    for other in statuses:
        if recognition is None or other.at.clock == recognition.at.clock:
            continue
        clock = clock_of(recognition, other)
        if clock is None:
            if other.participant in recognition.bus.peers:
                yield Diagnosis(
                    severity="doubtful", where=other.participant, what="recognition has not measured its clock",
                    do="run this again in some seconds; until then delays of connection events have no known error",
                )  # fmt: skip
        elif clock.error > PRECISE:
            yield Diagnosis(
                severity="note", where=other.participant,
                what=f"recognition knows its clock to {1000 * clock.error:.0f} ms, and its delays no better",
                do="nothing, if that is precise enough (`delay_error` tells it); else a quicker network",
            )  # fmt: skip
    told = set()
    for one in facts.known:
        host = one.name if one.status is None else one.status.process.host
        if host not in told and abs(one.wall) > WALL:
            told.add(host)
            apart = f"{abs(one.wall):.0f} s {'ahead of' if one.wall > 0 else 'behind'}"
            yield Diagnosis(
                severity="doubtful", where=host, what=f"its wall clock is {apart} this machine's",
                do="set it by NTP: logs are hard to compare, and certificates count by it (delays do not)",
            )  # fmt: skip


def certificates(facts: SystemFacts) -> dict[str, int]:
    """Ends of all certificates of holders, by their names: as their processes tell, else as the folder has them."""
    ends = {each.name: each.until for each in facts.certificates}
    for process in (facts.own, *(one.status.process for one in facts.known if one.status is not None)):
        if process.until is not None:
            ends[process.holder] = process.until
    return ends


def _certificates(facts: SystemFacts) -> Iterator[Diagnosis]:
    ends = certificates(facts) | {door.endpoint: door.until for door in facts.doors if door.until is not None}
    for where, until in ends.items():
        days = (until - facts.at) / A_DAY
        if days < SOON:
            left = span(until - facts.at)
            what = "the certificate has expired" if days <= 0 else f"the certificate expires in {left}"
            yield Diagnosis(
                severity="wrong" if days <= 0 else "doubtful", where=where, what=what,
                do="`engage keys renew` where the authority is; copy the folder anew, and start its holder again",
            )  # fmt: skip


def _abilities(facts: SystemFacts) -> Iterator[Diagnosis]:
    if facts.body is not None:
        if facts.body.problem:
            yield Diagnosis(
                severity="wrong", where="control", what=f"nothing is known of the body: {facts.body.problem}",
                do="look at what control has printed",
            )  # fmt: skip
        elif "speech" not in facts.body.types:
            yield Diagnosis(
                severity="doubtful", where=facts.body.name, what="the body has no voice",
                do="speech fails, unless your body performs it (docs/control.md)",
            )  # fmt: skip
    if facts.bus and facts.sight is None and any(one.name in facts.services for one in facts.known):
        yield Diagnosis(
            severity="doubtful", where="perception", what="nobody tells what there is to be seen",
            do="start what sees people, or `engage run simulation`: without a world fragments wait, and are refused",
        )  # fmt: skip


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names)


Rule = Callable[[SystemFacts], Iterator[Diagnosis]]
RULES: tuple[Rule, ...] = (
    _problem, _doors, _services, _sight_of_one_another, _answers, _versions, _certificates, _losses,
    _paths, _clocks, _abilities,
)  # fmt: skip
