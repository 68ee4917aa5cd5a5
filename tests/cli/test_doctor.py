"""`engage doctor`: findings from facts, the report, and the command where nothing or something else runs."""

import asyncio
import io
import json
import socket
from pathlib import Path

import msgspec
import pytest
from rich.console import Console

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.participants import ClockOffset
from engage_hri.services.doctor.findings import (
    HERE,
    BodyFacts,
    Certificate,
    Diagnosis,
    EndpointFacts,
    ParticipantFacts,
    SystemFacts,
    findings,
    matrix,
)
from engage_hri.services.doctor.report import as_json, report
from tests.cli.command import Engage, start
from tests.cli.doctor_facts import AT, NAMES, known, listening, well, with_one

SHUT = EndpointFacts(endpoint="tcp/10.0.0.1:7447", problem="no process listens there", is_local=False)
CLOSED = well().doors[0]


def without(name: str) -> tuple[ParticipantFacts, ...]:
    return tuple(one for one in well().known if one.name != name)


def hidden(*places: str) -> SystemFacts:
    """The simulation is not seen by recognition, and listens there."""
    blind = known("recognition", bus={"peers": keys.SERVICES, "clocks": (), **listening(*places)})
    return well(known=tuple(blind if one.name == "recognition" else one for one in well().known))


ILL: dict[str, tuple[SystemFacts, str, str, str]] = {
    "keys cannot be used": (
        well(bus=False, known=(), problem=Fault(reason="expired", where="keys/viewer", advice="renew")),
        "wrong",
        "keys/viewer",
        "expired",
    ),
    "nobody opens": (well(bus=False, known=(), doors=(SHUT,)), "wrong", SHUT.endpoint, "no process listens there"),
    "nobody opens at an address of IPv6": (
        well(bus=False, known=(), doors=(msgspec.structs.replace(SHUT, endpoint="tcp/[fd00::1]:7466"),)),
        "wrong",
        "tcp/[fd00::1]:7466",
        "no process listens there",
    ),
    "one of two opens": (well(doors=(SHUT, CLOSED)), "doubtful", SHUT.endpoint, "no process listens there"),
    "the network is open": (
        well(doors=(EndpointFacts(endpoint="tcp/10.0.0.1:7447", is_local=False),)),
        "doubtful",
        "tcp/10.0.0.1:7447",
        "open to all",
    ),
    "no robot": (
        well(known=(), found=("melvin",)),
        "wrong",
        "robot",
        "no service of this robot is on the bus; there are: melvin",
    ),
    "a service is missing": (
        well(known=without("realizer")),
        "wrong",
        "realizer",
        "nobody sees this service: it has ended, stands still, or is cut off",
    ),
    "another protocol": (well(protocols=(keys.PREFIX, "engage/v9")), "wrong", "robot", "somebody speaks engage/v9"),
    "a path is cut": (
        hidden("tcp/10.0.0.3:7448"),
        "wrong",
        "simulation",
        "not seen by recognition: it listens on tcp/10.0.0.3:7448, and the path there is cut",
    ),
    "it listens on loopback": (
        hidden("tcp/127.0.0.1:0"),
        "wrong",
        "simulation",
        "not seen by recognition: it listens on tcp/127.0.0.1 only",
    ),
    "another router": (hidden(), "wrong", "simulation", "it is there, but not seen by recognition"),
    "not seen from here": (with_one("control", seen=False), "wrong", "control", "not seen by here"),
    "two of a name": (with_one("control", lives=2), "wrong", "control", "2 processes have this name"),
    "silent": (
        well(known=(*without("control"), ParticipantFacts(name="control"))),
        "wrong",
        "control",
        "it is there, and does not answer",
    ),
    "not serving": (with_one("control", status={"stands": None}), "doubtful", "control", "it does not serve yet"),
    "another Engage": (
        with_one("control", status={"version": "0.2.0"}),
        "doubtful",
        "control",
        "Engage 0.2.0 on desk",
    ),
    "another Zenoh": (with_one("control", process={"zenoh": "1.9.0"}), "doubtful", "control", "Zenoh 1.9.0 on desk"),
    "an expired certificate": (
        with_one("control", process={"holder": "robot/control/control", "until": int(AT) - 5}),
        "wrong",
        "robot/control/control",
        "the certificate has expired",
    ),
    "a certificate of the folder": (
        well(certificates=(Certificate(name="robot/observer/viewer", until=int(AT) + 5 * 86400 + 5),)),
        "doubtful",
        "robot/observer/viewer",
        "expires in 5 days",
    ),
    "the router's certificate": (
        well(doors=(msgspec.structs.replace(CLOSED, until=int(AT) + 5),)),
        "doubtful",
        CLOSED.endpoint,
        "expires in a minute",
    ),
    "a service's certificate, of whom there is no folder here": (
        with_one("control", process={"holder": "robot/control/control", "until": int(AT) + 20 * 3600}),
        "doubtful",
        "robot/control/control",
        "expires in 20 hours",
    ),
    "bugs": (with_one("control", bus={"failures": 2}), "wrong", "control", "errors that are bugs: 2 since it came"),
    "losses": (
        with_one("control", bus={"lost": 2}),
        "doubtful",
        "control",
        "messages lost for good: 2 since it came",
    ),
    "losses now": (
        with_one("control", bus={"lost": 2}, later=known("control", bus={"lost": 3}).status),
        "wrong",
        "control",
        "messages lost for good: 3 since it came, and more just now",
    ),
    "gaps": (with_one("control", bus={"gaps": 2}), "note", "control", "gaps, all of which were filled: 2"),
    "refused": (with_one("control", bus={"refused": 1}), "doubtful", "control", "could not be read: 1"),
    "overflow": (with_one("control", bus={"overflowed": 1}), "doubtful", "control", "as nobody read them in time: 1"),
    "dropped": (with_one("control", bus={"dropped": 1}), "note", "control", "before its loop got to them: 1"),
    "it stood still": (with_one("control", bus={"lag": 0.5}), "note", "control", "messages once waited 0.50 s"),
    "a long way": (with_one("control", trip=0.3), "doubtful", "control", "round trips are long from here (300 ms)"),
    "a clock not measured": (
        with_one("recognition", bus={"clocks": ()}),
        "doubtful",
        "simulation",
        "recognition has not measured its clock",
    ),
    "a clock not well known": (
        with_one("recognition", bus={"clocks": (ClockOffset(clock="there", offset=1.0, error=0.03, trip=0.06),)}),
        "note",
        "simulation",
        "recognition knows its clock to 30 ms",
    ),
    "wall clocks": (
        with_one("control", wall=-70.0),
        "doubtful",
        "desk",
        "its wall clock is 70 s behind this machine's",
    ),
    "no body": (
        well(body=BodyFacts(problem="no reply")),
        "wrong",
        "control",
        "nothing is known of the body: no reply",
    ),
    "no voice": (well(body=BodyFacts(name="arm", types=("pointing",))), "doubtful", "arm", "the body has no voice"),
    "no world": (well(sight=None), "doubtful", "perception", "nobody tells what there is to be seen"),
}


def drawn(facts: SystemFacts, width: int) -> list[str]:
    console = Console(width=width, file=io.StringIO(), emoji=False)
    console.print(report(facts, findings(facts), width))
    return [line.rstrip() for line in console.file.getvalue().splitlines()]  # type: ignore[attr-defined]


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    assert findings(well()) == ()
    assert {cell.sees for cell in matrix(well())} == {"yes", "itself"}


@pytest.mark.parametrize(("days", "is_told"), [(30.01, False), (29.99, True)])
def test_a_certificate_is_told_from_thirty_days_before_its_end_on(days: float, *, is_told: bool) -> None:
    """As its own process warns of it (docs/security.md)."""
    facts = well(certificates=(Certificate(name="robot/observer/viewer", until=int(AT + days * 86400)),))

    assert [each.where for each in findings(facts)] == ["robot/observer/viewer"] * is_told


@pytest.mark.parametrize("what", ILL)
def test_each_thing_that_is_wrong_is_told_with_what_to_do(what: str) -> None:
    facts, severity, where, words = ILL[what]
    found = [each for each in findings(facts) if each.where == where and words in each.what]
    assert [each.severity for each in found] == [severity], findings(facts)
    assert found[0].do


def test_all_findings_together_come_with_the_worst_first() -> None:
    facts = with_one("control", bus={"gaps": 1, "refused": 1, "failures": 1})
    assert [each.severity for each in findings(facts)] == ["wrong", "doubtful", "note"]


def test_the_matrix_has_a_row_for_each_that_answers_and_a_column_for_all() -> None:
    facts = hidden("tcp/10.0.0.3:1")
    facts = msgspec.structs.replace(
        facts, known=(*facts.known, ParticipantFacts(name="watch-1", answers=False, trip=0.004))
    )
    cells = {(cell.viewer, cell.other): cell for cell in matrix(facts)}
    assert len(cells) == (1 + len(NAMES)) * (len(NAMES) + 1)
    assert cells["recognition", "simulation"].sees == "no"
    assert cells["simulation", "recognition"].sees == "yes"
    assert cells["simulation", "recognition"].trip == 0.002
    assert cells["control", "realizer"].trip is None
    assert cells[HERE, "watch-1"].trip == 0.004
    silent = well(known=(*without("control"), ParticipantFacts(name="control")))
    assert {cell.sees for cell in matrix(silent) if cell.viewer == "control"} == {"unknown", "itself"}


def test_services_need_to_see_their_clients_and_no_observer_whatever_its_name_is() -> None:
    """With keys `up` is an observer, and without them a client."""
    up, client, simulation = (
        ParticipantFacts(name="up-1234abcd", part="observer", answers=False),
        ParticipantFacts(name="up-5678abcd", part="client", answers=False),
        known("simulation"),
    )
    facts = well(known=(*without("simulation"), simulation, up, client))
    cells = {(cell.viewer, cell.other): cell.sees for cell in matrix(facts)}

    assert {cells[name, up.name] for name in NAMES} == {"needless"}
    assert {cells[name, client.name] for name in keys.SERVICES} == {"no"}
    assert cells["simulation", client.name] == "needless"
    assert [each.where for each in findings(facts)] == [client.name]


@pytest.mark.parametrize("width", [60, 80, 120, 200])
@pytest.mark.parametrize("what", ["well", *ILL])
def test_the_report_fits_and_has_all_that_was_found(what: str, width: int) -> None:
    facts = well() if what == "well" else ILL[what][0]
    lines = drawn(facts, width)
    assert max(map(len, lines)) <= width
    text = " ".join(" ".join(lines).split())
    for finding in findings(facts):
        assert finding.where in text
        assert finding.severity in text
    for door in facts.doors:
        assert f"{door.endpoint}: " in text
    assert ("Nothing is wrong." in text) == all(each.severity != "wrong" for each in findings(facts))


def test_the_matrix_is_drawn() -> None:
    wide, narrow = ([line.split() for line in drawn(hidden("tcp/10.0.0.3:1"), width)] for width in (100, 66))
    assert ["sees", *NAMES] in wide
    assert ["recognition", "yes", "yes", "·", "yes", "NO"] in wide
    assert ["sees", *"12345"] in narrow
    assert ["3", "recognition", "yes", "yes", "·", "yes", "NO"] in narrow
    assert ["here", *["1.0"] * 5] in narrow


def test_the_newest_counts_of_a_participant_are_drawn() -> None:
    facts = with_one("control", bus={"lost": 2}, later=known("control", bus={"lost": 7}).status)
    (row,) = [line.split() for line in drawn(facts, 120) if line.startswith("control") and "desk" in line]

    assert "7" in row
    assert "2" not in row


@pytest.mark.parametrize("width", [60, 80, 120])
def test_a_crowd_of_watchers_is_listed_below_the_matrix(width: int) -> None:
    watchers = tuple(ParticipantFacts(name=f"watch-{number}", answers=False) for number in range(60))
    lines = drawn(well(known=(*well().known, *watchers)), width)
    assert max(map(len, lines)) <= width
    (row,) = [line.split() for line in lines if "recognition" in line.split()[:2] and "·" in line]
    assert len(row) - row.index("recognition") == 1 + len(NAMES)
    assert all(f"watch-{number}" in " ".join(lines) for number in range(60))


def test_json_has_all() -> None:
    told = json.loads(as_json(hidden(), findings(hidden())))
    assert set(told) == {"facts", "findings", "matrix"}
    assert msgspec.convert(told["findings"], tuple[Diagnosis, ...]) == findings(hidden())
    assert msgspec.convert(told["facts"], SystemFacts) == hidden()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_nothing_runs(engage: Engage) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    told = engage("doctor", "--connect", endpoint)
    assert (told.code, told.err) == (1, "")
    assert f"{endpoint}: nobody opens: no process listens there" in " ".join(told.out.split())


@pytest.mark.real_time
@pytest.mark.parametrize("arguments", [("--mode", "client"), ()], ids=["client", "peer"])
async def test_somebody_else_listens_there(arguments: tuple[str, ...]) -> None:
    """A program that takes links, and never says a word."""
    with socket.socket() as server:
        server.bind(("127.0.0.1", 0))
        server.listen()
        port = server.getsockname()[1]
        process = await start("doctor", "--json", "--connect", f"tcp/127.0.0.1:{port}", *arguments)
        out, err = await asyncio.wait_for(process.communicate(), 40)
    assert process.returncode == 1, err
    wrong = [each["what"] for each in json.loads(out)["findings"] if each["severity"] == "wrong"]
    client = "somebody opens there, and lets us in to no bus"
    assert wrong == [client if arguments else "no service of this robot is on the bus"]


def test_keys_that_are_not_there(engage: Engage, tmp_path: Path) -> None:
    told = engage("doctor", "--keys", tmp_path, "--connect", f"tls/127.0.0.1:{free_port()}")
    assert told.code == 1
    assert "no keys of 'viewer'" in " ".join(told.out.split())


def test_what_cannot_be_is_refused(engage: Engage) -> None:
    told = engage("doctor", "--connect", "nowhere")
    assert (told.code, told.out) == (2, "")
    assert "'nowhere' is not an endpoint" in told.err
