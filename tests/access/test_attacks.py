"""Attacks on a running robot with keys: nothing comes of them, and each is in a log.

The first line of each docstring is a row of the table in docs/security.md.
"""

import re
import time
from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import msgspec
import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.access import Holder
from engage_hri.schemas.body import SyncPointReached
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.messages import Message, encode, encoding_of
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.zenoh.order import Envelope, Missing
from tests.access.fortress import Fortress, Told
from tests.bus.places import PATIENCE, free_endpoint

pytestmark = pytest.mark.real_time
DAY = timedelta(days=1)
pack = msgspec.msgpack.encode


def fragment(id: str, words: str = "one two three") -> dict[str, object]:
    speech = {"type": "speech", "id": "s", "text": words}
    return {"type": "perform_fragment", "id": id, "life": "1", "fragment": {"id": id, "behaviors": [speech]}}


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fortress]:
    robot = Fortress(tmp_path_factory.mktemp("robot"))
    try:
        robot.start()
        yield robot
    finally:
        robot.close()


@pytest.fixture(autouse=True)
def _unharmed(robot: Fortress, request: pytest.FixtureRequest) -> Iterator[None]:
    """After each attack the robot does what a manager asks."""
    yield
    id = f"after-{request.node.name}"
    robot.ask("generation/manager/alice/fragment", **fragment(id, "well"))
    robot.wait(lambda: ended(robot, id), id)
    assert ended(robot, id) == "done"


def ended(robot: Fortress, id: str) -> str:
    return next((each.status for each in robot.answers(id) if isinstance(each, FragmentOutcome)), "")


def one_of(robot: Fortress, key: str) -> tuple[Message, zenoh.Sample]:
    """A message that was published on this key."""
    robot.wait(lambda: any(each[0] == key for each in robot.seen), key)
    return next((message, sample) for at, message, sample in robot.seen if at == key)


def run_of(robot: Fortress, key: str) -> str:
    """Id of the process that publishes on this key."""
    _, sample = one_of(robot, key)
    assert sample.source_info is not None
    return str(sample.source_info.source_id.zid)


def test_no_certificate(robot: Fortress) -> None:
    """A stranger without a certificate connects."""
    with pytest.raises(zenoh.ZError):
        zenoh.open(robot.config(None))
    robot.router.expect("refused a link", "no certificates")


def test_no_encryption(robot: Fortress) -> None:
    """A stranger connects without encryption."""
    since = len(robot.router.lines)
    with pytest.raises(zenoh.ZError):
        zenoh.open(robot.config(None, robot.endpoint.replace("tls/", "tcp/")))
    robot.router.expect("refused a link", since=since)


def test_a_certificate_of_his_own(robot: Fortress, tmp_path: Path) -> None:
    """A stranger makes a certificate in the name of control."""
    folder = robot.certificate(tmp_path / "k", "robot/control/control", -DAY, DAY, own=True)
    with pytest.raises(zenoh.ZError):
        zenoh.open(robot.config(folder))
    robot.router.expect("refused a link", "invalid peer certificate")


def test_expired(robot: Fortress, tmp_path: Path) -> None:
    """A holder comes with an expired certificate."""
    folder = robot.certificate(tmp_path / "k", "robot/manager/alice", -2 * DAY, -DAY)
    with pytest.raises(zenoh.ZError):
        zenoh.open(robot.config(folder))
    robot.router.expect("refused a link", "certificate expired")


def test_expiring(robot: Fortress, tmp_path: Path) -> None:
    """A certificate expires while its holder is connected."""
    folder = robot.certificate(tmp_path / "k", "robot/manager/alice", -DAY, timedelta(seconds=4))
    session = robot.session(folder)
    assert [*session.info.routers_zid()]
    robot.wait(lambda: not [*session.info.routers_zid()], "the end of the link")
    with pytest.raises(zenoh.ZError):
        zenoh.open(robot.config(folder))


def test_not_let_in(robot: Fortress, tmp_path: Path) -> None:
    """A holder whose keys were revoked commands."""
    folder = robot.certificate(tmp_path / "k", "robot/manager/carol", -DAY, DAY)
    session = robot.session(folder)
    robot.command(session, "generation/manager/carol/fragment", **fragment("revoked"))
    robot.router.expect("denied: robot/manager/carol", "not let in")
    robot.settle()
    assert not robot.answers("revoked")


@pytest.mark.parametrize("sender", ["observer/viewer", "manager/alice", "realizer/realizer"])
def test_a_viewer_who_commands(robot: Fortress, sender: str) -> None:
    """A viewer commands, in the own name, in a manager's, in a service's."""
    viewer, id = robot.session("viewer"), f"viewer-as-{sender.partition('/')[0]}"
    robot.command(viewer, f"generation/{sender}/fragment", **fragment(id))
    block = {"id": id, "behaviors": [{"type": "speech", "id": "s", "text": "x"}]}
    robot.command(viewer, f"realizer/{sender}/block", type="perform_block", id=id, block=block)
    robot.command(viewer, f"control/{sender}/behavior", type="go_home", id=id)
    for server, subject in (("generation", "fragment"), ("realizer", "block"), ("control", "behavior")):
        key = f"robot/{keys.PREFIX}/cmd/{server}/{sender}/{subject}"
        robot.router.expect(f"denied: robot/observer/viewer may not put {key}")
    robot.settle()
    assert not robot.answers(id)


def test_a_viewer_who_commands_by_history(robot: Fortress) -> None:
    """A viewer hands a command of a manager to those who ask for what was said before."""
    forged = keys.command(keys.FRAGMENT, "manager", "alice")
    play_history(robot, "observer", "viewer", forged, pack(fragment("from-history")), "application/msgpack")
    robot.settle()
    assert not robot.answers("from-history")


def test_a_manager_who_forges_sync_points_by_history(robot: Fortress) -> None:
    """A manager hands out forged sync points as what was said before."""
    play_history(robot, "manager", "bob", keys.SYNC_POINT, encode(REACHED), encoding_of(REACHED))
    robot.settle()
    assert not [message for _, message, _ in robot.seen if message == REACHED]


def play_history(robot: Fortress, role: str, holder: str, key: str, payload: bytes, encoding: str) -> None:
    """Show a process that has said this, and tell whoever asks."""
    run = f"{Holder(robot='robot', role=role, name=holder).mark}{'1' * 24}"
    session = robot.session(holder, id=run)
    written = (key, encoding, payload, Envelope(holder, "boot-00000000", time.monotonic(), 1, 1))

    def tell(query: zenoh.Query) -> None:
        query.reply(key, pack([written]))
        query.reply(keys.own(run, "counts"), pack({key: 1}))
        query.drop()

    session.declare_queryable(keys.own(run, "past"), zenoh.handlers.Callback(tell, indirect=False))
    shown = (f"alive/{keys.part_of(role)}/{holder}/boot-0", "log/news")
    tokens = [session.liveliness().declare_token(keys.own(run, each)) for each in shown]
    robot.router.expect(f"denied: robot/{role}/{holder} may not reply robot/{key}")
    for token in tokens:
        token.undeclare()


REACHED = SyncPointReached(
    id="x/s", block="x", behavior="s", sync="end",
    at=Stamp("boot-00000000", 1.0), arrived=Stamp("boot-00000000", 1.0),
)  # fmt: skip


@pytest.mark.parametrize("key", [keys.SYNC_POINT, f"{keys.PREFIX}/evt/control/*", keys.of_class("evt")])
def test_a_manager_who_forges_sync_points(robot: Fortress, key: str) -> None:
    """A manager forges sync points, also on keys with wildcards."""
    robot.session("bob").put(key, encode(REACHED), encoding=encoding_of(REACHED))
    robot.router.expect(f"denied: robot/manager/bob may not put robot/{key}")
    robot.settle()
    assert not [message for _, message, _ in robot.seen if message == REACHED]


def test_a_manager_who_deletes(robot: Fortress) -> None:
    """A manager deletes the world."""
    robot.session("bob").delete(keys.WORLD)
    robot.router.expect(f"denied: robot/manager/bob may not delete robot/{keys.WORLD}")


def test_a_manager_who_cancels_anothers_fragment(robot: Fortress) -> None:
    """A manager cancels the fragment of another, on the other's key and on the own one."""
    bob = robot.session("bob")
    robot.ask("generation/manager/alice/fragment", **fragment("precious", "one two three four five"))
    robot.wait(lambda: any(isinstance(each, Accepted) for each in robot.answers("precious")), "accepted")
    cancel = {"type": "cancel", "id": "precious", "life": "1", "of": "perform_fragment", "requester": "alice"}
    robot.command(bob, "generation/manager/alice/cancel", **cancel)
    robot.command(bob, "generation/manager/bob/cancel", **cancel)
    robot.router.expect("denied: robot/manager/bob may not put", "/cmd/generation/manager/alice/cancel")
    robot.logged("generation: ", "Cancel of 'alice' comes from 'bob'")
    robot.wait(lambda: ended(robot, "precious"), "the end")
    assert ended(robot, "precious") == "done"
    refused = [each for each in robot.answers("precious") if isinstance(each, Refused)]
    assert {each.requester for each in refused} == {"bob"}


def test_a_manager_in_anothers_name(robot: Fortress) -> None:
    """A manager shows the token of another, who would seem to have been restarted."""
    mark = Holder(robot="robot", role="manager", name="bob").mark
    bob = robot.session("bob", id=f"{mark}{'2' * 24}")
    for run in (f"{mark}{'2' * 24}", run_of(robot, keys.SYNC_POINT)):
        for name in ("client/alice", "robot/control"):
            bob.liveliness().declare_token(keys.own(run, f"alive/{name}/boot-0"))
            shown = f"robot/{keys.own(run, f'alive/{name}/boot-0')}"
            robot.router.expect("denied: robot/manager/bob may not", "liveliness token", shown)


def test_a_manager_who_plays_back_anothers_command(robot: Fortress) -> None:
    """A manager plays back a command of another, as it was recorded."""
    bob, id, key = robot.session("bob"), "played-back", keys.command(keys.FRAGMENT, "manager", "alice")
    robot.ask("generation/manager/alice/fragment", **fragment(id))
    robot.wait(lambda: ended(robot, id), "the end")
    bob.put(key, pack(fragment(id)), encoding="application/msgpack")
    robot.router.expect(f"denied: robot/manager/bob may not put robot/{key}")
    robot.settle()
    assert len([each for each in robot.answers(id) if isinstance(each, Accepted | FragmentOutcome)]) == 2


def test_a_command_that_comes_again(robot: Fortress) -> None:
    """A command is played back by the program that had sent it."""
    id = "once-more"
    for _ in range(2):
        robot.command(robot.alice, "generation/manager/alice/fragment", **fragment(id))
        robot.wait(lambda: ended(robot, id), "the end")
    robot.settle()
    outcomes = [each for each in robot.answers(id) if isinstance(each, FragmentOutcome)]
    assert len(outcomes) == 2
    assert outcomes[0] == outcomes[1]
    assert len([each for each in robot.answers(id) if isinstance(each, Accepted)]) == 1


def test_a_viewer_who_plays_back_sync_points(robot: Fortress) -> None:
    """A viewer plays back sync points of control, with their envelopes."""
    message, sample = one_of(robot, keys.SYNC_POINT)
    viewer = robot.session("viewer")
    viewer.put(
        keys.SYNC_POINT, encode(message), encoding=encoding_of(message), attachment=sample.attachment,
        source_info=sample.source_info, timestamp=sample.timestamp,
    )  # fmt: skip
    robot.router.expect(f"denied: robot/observer/viewer may not put robot/{keys.SYNC_POINT}")


def test_a_forged_envelope(robot: Fortress) -> None:
    """A manager writes the process of a service, and a number far ahead, on the own command."""
    _, sample = one_of(robot, keys.SYNC_POINT)
    key = keys.command(keys.FRAGMENT, "manager", "bob")
    robot.session("bob").put(
        key, pack(fragment("far-ahead")), encoding="application/msgpack", source_info=sample.source_info,
        attachment=pack(Envelope("control", "boot-00000000", 0.0, 10**9, 10**9)),
    )  # fmt: skip
    robot.up.expect("dropped: a message on", key, run_of(robot, keys.SYNC_POINT))
    robot.settle()
    assert not robot.answers("far-ahead")


def test_a_manager_who_answers_for_control(robot: Fortress) -> None:
    """A manager answers the questions that are for control."""
    asked: list[zenoh.Query] = []
    bob = robot.session("bob")
    bob.declare_queryable(keys.ESTIMATE, zenoh.handlers.Callback(asked.append, indirect=False))
    robot.router.expect(f"denied: robot/manager/bob may not declare queryable robot/{keys.ESTIMATE}")
    robot.ask("generation/manager/alice/fragment", **fragment("estimated"))
    robot.wait(lambda: ended(robot, "estimated"), "the end")
    assert not asked


def test_a_viewer_who_overhears_commands(robot: Fortress) -> None:
    """A viewer listens to commands, or asks for them."""
    heard: list[object] = []
    viewer = robot.session("viewer")
    everything = keys.of_class("cmd")
    viewer.declare_subscriber(everything, zenoh.handlers.Callback(heard.append, indirect=False))
    viewer.get(everything, zenoh.handlers.Callback(heard.append, indirect=False))
    for what in ("declare subscriber", "query"):
        robot.router.expect(f"denied: robot/observer/viewer may not {what} robot/{everything}")
    robot.ask("generation/manager/alice/fragment", **fragment("secret"))
    robot.wait(lambda: ended(robot, "secret"), "the end")
    assert not [each for each in heard if isinstance(each, zenoh.Sample) or each.ok]  # type: ignore[attr-defined]


def test_a_viewer_who_overhears_commands_by_history(robot: Fortress) -> None:
    """A viewer asks a process for its past commands."""
    key = keys.of_class("cmd")
    run = run_of(robot, keys.request_state("generation"))
    options = {"accept_replies": zenoh.ReplyKeyExpr.ANY, "consolidation": zenoh.ConsolidationMode.NONE}
    viewer = robot.session("viewer")
    assert not [reply for reply in viewer.get(f"{key}?run={run}", **options) if reply.ok]
    robot.router.expect(f"denied: robot/observer/viewer may not query robot/{key}")
    question = pack(((key,), Missing(is_new=False)))
    replies = viewer.get(keys.own(run, "past"), payload=question, **options)
    assert [str(reply.ok.key_expr) for reply in replies if reply.ok] == [keys.own(run, "counts")]


def test_a_holder_who_plays_the_router(robot: Fortress) -> None:
    """A manager plays the router, for services that call the wrong address."""
    endpoint = free_endpoint().replace("tcp/", "tls/")
    own = robot.ring / "bob"
    config = robot.config(own)
    for key, value in {
        "mode": '"router"', "connect/endpoints": "[]", "listen/endpoints": f'["{endpoint}"]',
        "transport/link/tls/listen_certificate": f'"{own / "certificate.pem"}"',
        "transport/link/tls/listen_private_key": f'"{own / "private.pem"}"',
    }.items():  # fmt: skip
        config.insert_json5(key, value)
    config.insert_json5("namespace", "null")
    trap = zenoh.open(config)
    try:
        with pytest.raises(zenoh.ZError):
            zenoh.open(robot.config(robot.ring / "control", endpoint))
    finally:
        trap.close()


def test_the_robot_itself_is_denied_nothing(robot: Fortress, tmp_path: Path) -> None:
    """Beside all these attacks, and with a manager and a watcher of ours."""
    file = tmp_path / "block.xml"
    file.write_text('<bml id="b1"><speech id="s1"><text>here I am</text></speech></bml>')
    watch = Told("watch", **robot.environment)
    play = Told("play", file, **robot.environment)
    play.expect("block b1: done")
    watch.expect("here I am")
    watch.end()
    assert play.process.wait(PATIENCE) == 0
    play.end()
    robot.settle()
    robot.router.expect("manager-client-", "gone")
    denied = [line for line in robot.router.lines if line.startswith("denied")]
    assert len(denied) > 20
    assert not [line for line in denied if not re.match("denied: robot/(observer/viewer|manager/(bob|carol)) ", line)]
