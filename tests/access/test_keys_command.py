"""`engage keys`, as people type it."""

import json
from datetime import datetime, tzinfo
from pathlib import Path
from random import Random

import pytest
import zenoh
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from engage_hri.schemas.access import PARTICIPANTS
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.services.bus.certificates import STANDARD
from engage_hri.services.bus.config import BusConfig
from engage_hri.services.bus.keyring import read_keys
from engage_hri.services.bus.zenoh.session import open_router
from engage_hri.services.commandline.shell.process import UNREADY
from engage_hri.services.doctor.service import _certificates
from tests.cli.command import Engage
from tests.cli.command import engage as made
from tests.random_cases import share_of


@pytest.fixture
def engage(capsys: pytest.CaptureFixture[str]) -> Engage:
    return made(capsys)


@pytest.fixture
def ring(engage: Engage, tmp_path: Path) -> Path:
    assert engage("keys", "init", tmp_path / "ring", "manager=alice", "--robot", "melvin").code == 0
    return tmp_path / "ring"


@pytest.mark.parametrize("do", ["init", "add", "show"])
def test_a_file_where_the_folder_should_be_is_told_in_words(engage: Engage, tmp_path: Path, do: str) -> None:
    (tmp_path / "file").write_text("no folder")
    ran = engage("keys", do, tmp_path / "file", *(["manager=bob"] if do == "add" else []))
    assert ran.code == 2
    assert f"{tmp_path / 'file'}: this is no folder (keys are in a folder: name that)" in ran.err


@pytest.mark.parametrize("host", ["not a host!", "höhle", "a:7447", "-", ""])
def test_a_host_that_can_be_none_is_refused_before_anything_is_made(
    engage: Engage, tmp_path: Path, host: str
) -> None:
    ran = engage("keys", "init", tmp_path / "ring", "--host", host)
    assert (ran.code, (tmp_path / "ring").exists()) == (2, False)
    assert f"{host!r} is no host" in ran.err


@pytest.mark.parametrize(
    ("endpoint", "advice"),
    [
        ("tcp/203.0.113.7:7447", "listen at an address of this machine"),
        ("tcp/no-such-machine.invalid:7447", "no machine of this name is known"),
    ],
)
def test_where_nobody_can_listen_is_told_with_what_to_do(endpoint: str, advice: str) -> None:
    with pytest.raises(RunFailed) as raised:
        open_router((), [endpoint])
    assert raised.value.fault.where == endpoint
    assert advice in raised.value.fault.advice
    assert "so_rcvbuf" not in raised.value.fault.reason


def test_a_router_at_an_encrypted_endpoint_without_keys_is_refused(engage: Engage) -> None:
    ran = engage("router", "--listen", "tls/127.0.0.1:7448")
    assert ran.code == 2
    assert "'tls/127.0.0.1:7448' without keys" in ran.err
    assert "--keys FOLDER" in ran.err


def test_init_gives_keys_to_all_that_a_robot_has(ring: Path) -> None:
    for name, role in {**PARTICIPANTS, "alice": "manager", "viewer": "observer", "router": "router"}.items():
        keys = read_keys(ring, name)
        assert keys.holder.common_name == f"melvin/{role}/{name}"
        assert keys == read_keys(ring / name, "whoever")
    assert [holder.name for holder in read_keys(ring, "router").holders() if holder.role == "manager"] == [
        "alice", "collaboration", "manager",
    ]  # fmt: skip


def test_private_keys_are_for_their_owner_only(ring: Path) -> None:
    private = [path for path in ring.rglob("*") if "private" in path.name]
    assert len(private) == len(STANDARD) + len(("alice", "authority"))
    assert {path.stat().st_mode & 0o777 for path in private} == {0o600}
    (ring / "alice" / "private.pem").chmod(0o640)
    with pytest.raises(InputRefused, match="others may read this private key"):
        read_keys(ring, "alice")


@pytest.mark.parametrize("gone", [(), ("ca.pem",), ("ca.pem", "ca.private.pem")])
def test_init_overwrites_nothing(engage: Engage, ring: Path, gone: tuple[str, ...]) -> None:
    for name in gone:
        (ring / name).unlink()
    before = {path: path.read_bytes() for path in ring.rglob("*") if path.is_file()}
    result = engage("keys", "init", ring)
    assert result.code == 2
    assert "there are keys already" in result.err
    assert before == {path: path.read_bytes() for path in ring.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("holder", "told"),
    [
        ("manager=alice", "the name is taken"),
        ("manager=alice-b", "the name is taken"),
        ("observer=control", "the name is taken"),
        ("control=mine", "no role 'control' to give out"),
        ("king=mine", "no role 'king' to give out"),
        ("manager=a/b", "can't be in a key"),
        ("manager=..", "can't be in a key"),
        ("manager=", "can't be in a key"),
        (f"manager={'a' * 60}", "too long for a certificate"),
        ("carol", "no holder"),
    ],
)
def test_a_holder_that_cannot_be_is_refused(engage: Engage, ring: Path, holder: str, told: str) -> None:
    before = sorted(ring.rglob("*"))
    result = engage("keys", "add", ring, holder)
    assert (result.code, sorted(ring.rglob("*"))) == (2, before)
    assert told in result.err


def test_show_tells_when_each_expires_and_fails_once_one_has(engage: Engage, ring: Path) -> None:
    assert engage("keys", "add", ring, "observer=lobby", "--days", 7).code == 0
    shown = engage("keys", "show", ring)
    assert shown.code == 0
    assert shown.out.splitlines()[0].split()[:2] == ["lobby", "melvin/observer/lobby"]
    assert "6 days" in shown.out.splitlines()[0]
    assert "melvin/authority" in shown.out.splitlines()[-1]
    assert engage("keys", "show", ring / "alice").out.count("\n") == 1


def test_show_marks_who_was_revoked_and_does_not_mind_that_it_expires(
    engage: Engage, ring: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert engage("keys", "add", ring, "observer=lobby", "--days", 7).code == 0
    assert "REVOKED" not in engage("keys", "show", ring).out
    assert engage("keys", "revoke", ring, "lobby").code == 0
    *rest, last = engage("keys", "show", ring).out.splitlines()
    assert last.split()[0] == "lobby"
    assert last.endswith("6 days, REVOKED")
    assert not any("REVOKED" in line for line in rest)
    assert engage("keys", "show", ring / "lobby").out.endswith("6 days, REVOKED\n")
    alone = ring.parent / "elsewhere"
    (ring / "lobby").rename(alone)
    assert engage("keys", "show", alone).out.endswith("6 days\n")
    alone.rename(ring / "lobby")

    class Later(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> "Later":
            return cls.fromtimestamp(datetime.now(tz).timestamp() + 8 * 86400, tz)

    monkeypatch.setattr("engage_hri.services.commandline.robot.keys.datetime", Later)
    result = engage("keys", "show", ring)
    assert (result.code, result.out.splitlines()[-1][-16:]) == (0, "EXPIRED, REVOKED")


def test_doctor_does_not_mind_the_certificates_of_who_was_revoked(engage: Engage, ring: Path) -> None:
    assert engage("keys", "revoke", ring, "alice").code == 0
    names = {each.name for each in _certificates(BusConfig(keys=str(ring)))}
    assert "melvin/observer/viewer" in names
    assert "melvin/manager/alice" not in names
    alone = {each.name for each in _certificates(BusConfig(keys=str(ring / "alice")))}
    assert alone == {"melvin/manager/alice"}


def test_renew_keeps_the_private_key_and_the_hosts(engage: Engage, ring: Path) -> None:
    names = ("certificate.pem", "private.pem", "holder.json")
    before = {name: (ring / "router" / name).read_bytes() for name in names}
    assert engage("keys", "renew", ring, "router", "--days", 700).code == 0
    after = {name: (ring / "router" / name).read_bytes() for name in names}
    assert [before[name] == after[name] for name in names] == [False, True, False]
    from cryptography import x509

    hosts = x509.SubjectAlternativeName
    old, new = (x509.load_pem_x509_certificate(each["certificate.pem"]).extensions for each in (before, after))
    assert old.get_extension_for_class(hosts) == new.get_extension_for_class(hosts)
    assert engage("keys", "renew", ring, "nobody").code == 2


def test_revoked_holders_have_no_rules(engage: Engage, ring: Path) -> None:
    assert "melvin/manager/alice" in engage("keys", "acl", ring).out
    assert engage("keys", "revoke", ring, "alice").code == 0
    assert "melvin/manager/alice" not in engage("keys", "acl", ring).out
    assert engage("keys", "revoke", ring, "alice").code == 2
    assert engage("keys", "revoke", ring, "router").code == 2


def test_zenoh_takes_the_rules(engage: Engage, ring: Path) -> None:
    section = json.loads(engage("keys", "acl", ring / "router").out)["access_control"]
    config = zenoh.Config()
    config.insert_json5("access_control", json.dumps(section))
    assert (section["enabled"], section["default_permission"]) == (True, "deny")
    assert {rule["permission"] for rule in section["rules"]} == {"allow"}
    for rule in section["rules"]:
        for key in rule["key_exprs"]:
            zenoh.KeyExpr(key)
            assert key.startswith("melvin/") or "router/router" in rule["id"]


def test_an_expired_certificate_is_told_before_anybody_is_called(ring: Path) -> None:
    file = ring / "alice" / "holder.json"
    file.write_text(file.read_text().replace('"until":', '"until":1,"was":').replace(',"was":', ',"x":'))
    with pytest.raises(InputRefused, match="damaged"):
        read_keys(ring, "alice")
    file.write_text('{"robot":"melvin","role":"manager","name":"alice","until":1}')
    with pytest.raises(InputRefused, match="has expired"):
        read_keys(ring, "alice")


def _contradict_each_other(folder: Path) -> bool:
    """Tell by another library whether a signature is wrong: the authority's, or one with the private key.

    What OpenSSL reads and this library refuses to read, such as a damaged copy of the public key, does not matter.
    """
    try:
        authority = x509.load_pem_x509_certificate((folder / "ca.pem").read_bytes())
        certificate = x509.load_pem_x509_certificate((folder / "certificate.pem").read_bytes())
        private = serialization.load_pem_private_key((folder / "private.pem").read_bytes(), None)
        public = certificate.public_key()
        assert isinstance(private, ec.EllipticCurvePrivateKey)
        assert isinstance(public, ec.EllipticCurvePublicKey)
        certificate.verify_directly_issued_by(authority)
        public.verify(private.sign(b"words", ec.ECDSA(hashes.SHA256())), b"words", ec.ECDSA(hashes.SHA256()))
    except InvalidSignature:
        return True
    except Exception:  # it refuses to read it
        return False
    return False


@pytest.mark.parametrize("file", ["ca.pem", "certificate.pem", "private.pem"])
def test_a_damaged_file_of_keys_is_named_before_anybody_is_called(ring: Path, file: str) -> None:
    path, random = ring / "alice" / file, Random(file)
    whole = path.read_bytes()
    refused = 0
    for _ in range(share_of(600, 10)):
        bad = bytearray(whole)
        bad[random.randrange(len(bad))] ^= 1 << random.randrange(8)
        path.write_bytes(bad)
        fault = _refusal(ring)
        refused += fault is not None
        if fault is None:
            assert not _contradict_each_other(ring / "alice"), bytes(bad)
        else:
            assert file in f"{fault.where} {fault.reason}"
            assert fault.advice
    assert refused > share_of(600, 10) / 2
    path.write_bytes(whole)
    read_keys(ring, "alice")


def _refusal(ring: Path) -> Fault | None:
    try:
        read_keys(ring, "alice")
    except InputRefused as error:
        return error.fault
    return None


def test_keys_of_another_authority_are_told_apart(ring: Path, engage: Engage) -> None:
    assert engage("keys", "init", ring.parent / "other", "manager=alice", "--robot", "melvin").code == 0
    (ring / "alice" / "ca.pem").write_bytes((ring.parent / "other" / "alice" / "ca.pem").read_bytes())

    with pytest.raises(InputRefused, match=r"not accepted with the ca\.pem beside it"):
        read_keys(ring, "alice")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (("play", "BLOCK", "--keys", "RING", "--connect", "tcp/127.0.0.1:1"), "connect to tls/HOST:PORT"),
        (("play", "BLOCK", "--keys", "RING"), "these keys are for robot 'melvin', not 'robot'"),
        (("play", "BLOCK", "--keys", "RING", "--mode", "peer"), "mode 'peer' with keys"),
        (("run", "control", "--keys", "RING", "--robot", "melvin", "--listen", "tls/127.0.0.1:1"), "does not listen"),
        (("play", "BLOCK", "--keys", "NOWHERE"), "no keys of 'manager'"),
        (("router", "--listen", "tcp/127.0.0.1:0", "--keys", "RING"), "tls/HOST:PORT"),
        (("router", "--listen", "tls/127.0.0.1:0", "--keys", "ALICE"), "not of a router"),
    ],
)
def test_keys_that_do_not_fit_are_refused(
    engage: Engage, ring: Path, tmp_path: Path, call: tuple[str, ...], told: str
) -> None:
    block = tmp_path / "block.xml"
    block.write_text('<bml id="b1"><speech id="s1"><text>here I am</text></speech></bml>')
    places = {"BLOCK": block, "RING": ring, "ALICE": ring / "alice", "NOWHERE": tmp_path}
    result = engage(*(places.get(word, word) for word in call))
    assert result.code == (UNREADY if "NOWHERE" in call else 2)  # keys that are not there yet may come
    assert told in result.err


def test_keys_make_every_process_a_client() -> None:
    from engage_hri.services.bus.config import mode_of

    assert BusConfig(keys="/k").keys == "/k"
    assert mode_of("auto", (), (), "/k") == "client"
    with pytest.raises(ValueError, match="tls/HOST:PORT"):
        BusConfig(keys="/k", connect=("tcp/10.0.0.1:7447",))
