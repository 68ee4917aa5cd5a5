"""A robot behind keys: a router and all services as processes, and attackers that speak plain Zenoh to it."""

import json
import os
import select
import subprocess
import sys
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Any

import zenoh
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message, decode
from engage_hri.services.bus.certificates import initialize
from tests.bus.places import OWN_ADDRESS, PATIENCE, free_endpoint

PEM = serialization.Encoding.PEM
AGAIN = 2.0
"""Seconds after which a command without an answer is sent again."""


class Told:
    """What a process prints, line by line."""

    module = "engage_hri"

    def __init__(self, *arguments: object, **environment: str) -> None:
        command = [sys.executable, "-m", self.module, *map(str, arguments)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, bufsize=0,
            env={**os.environ, **environment},
        )  # fmt: skip
        self.lines: list[str] = []
        self._rest = b""

    def expect(self, *words: str, since: int = 0, patience: float = PATIENCE) -> str:
        """Wait for a line with all these words."""
        assert self.process.stdout is not None
        while True:
            for line in self.lines[since:]:
                if all(word in line for word in words):
                    return line
            ready, _, _ = select.select([self.process.stdout], [], [], patience)
            assert ready, f"{words} did not come: {self.lines[since:]}"
            came = self.process.stdout.read(2**16)
            assert came, f"ended without {words}: {self.lines}"
            *lines, self._rest = (self._rest + came).split(b"\n")
            self.lines += [line.decode() for line in lines]

    def drain(self) -> None:
        """Take the lines that are there, without waiting."""
        assert self.process.stdout is not None
        while select.select([self.process.stdout], [], [], 0)[0] and (came := self.process.stdout.read(2**16)):
            *lines, self._rest = (self._rest + came).split(b"\n")
            self.lines += [line.decode() for line in lines]

    def end(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=PATIENCE)


class Fortress:
    """The robot, and what a witness sees of it."""

    def __init__(self, folder: Path) -> None:
        self.ring = folder / "ring"
        self.endpoint = free_endpoint().replace("tcp/", "tls/")
        initialize(self.ring, "robot", [("manager", "alice"), ("manager", "bob")], [OWN_ADDRESS], 2)
        self.authority = (
            x509.load_pem_x509_certificate((self.ring / "ca.pem").read_bytes()),
            serialization.load_pem_private_key((self.ring / "ca.private.pem").read_bytes(), None),
        )
        self.log = folder / "log"
        """What the services log."""
        self._numbers = count(1)
        self._stack = ExitStack()
        self.seen: list[tuple[str, Message, zenoh.Sample]] = []
        self._sessions: list[zenoh.Session] = []

    @property
    def environment(self) -> dict[str, str]:
        """Variables by which processes of ours find the robot."""
        return {"ENGAGE_BUS_KEYS": str(self.ring), "ENGAGE_BUS_CONNECT": self.endpoint}

    def start(self) -> None:
        self.router = Told("router", "--listen", self.endpoint, "--keys", self.ring)
        self._stack.callback(self.router.end)
        self.router.expect("router is ready")
        environment = self.environment
        self.up = Told("up", "--log", self.log, **environment)
        self._stack.callback(self.up.end)
        self.up.expect("all services are up")
        witness = self.session("viewer")
        for pattern in (keys.ANY_REQUEST_STATE, keys.ANY_FEEDBACK, keys.SYNC_POINT, keys.ANY_CONNECTION_EVENT):
            witness.declare_subscriber(pattern, zenoh.handlers.Callback(self._see, indirect=False))
        self.alice = self.session("alice")
        self.settle()

    def close(self) -> None:
        for session in self._sessions:
            session.close()
        self._stack.close()

    def _see(self, sample: zenoh.Sample) -> None:
        message = decode(sample.payload.to_bytes(), str(sample.encoding))
        self.seen.append((str(sample.key_expr), message, sample))

    def config(self, folder: Path | None, endpoint: str = "", **more: object) -> zenoh.Config:
        """Settings of a visitor. folder: of its keys; None: it has none, and believes everybody."""
        tls: dict[str, object] = {"root_ca_certificate": str(self.ring / "ca.pem")}
        if folder is not None:
            tls |= {f"connect_{what}": str(folder / name) for what, name in _OWN} | {"enable_mtls": True}
        settings = {
            "mode": "client", "connect/endpoints": [endpoint or self.endpoint], "connect/timeout_ms": 1500,
            "connect/exit_on_failure": True, "scouting/multicast/enabled": False, "timestamping/enabled": True,
            "namespace": "robot", "transport/link/tls": tls, **more,
        }  # fmt: skip
        config = zenoh.Config()
        for key, value in settings.items():
            config.insert_json5(key, json.dumps(value))
        return config

    def session(self, holder: str | Path, **more: object) -> zenoh.Session:
        """Open a link with the keys of a holder, or with those in a folder."""
        session = zenoh.open(self.config(self.ring / holder, **more))
        self._sessions.append(session)
        return session

    def settle(self, session: zenoh.Session | None = None) -> None:
        """Wait until both servers of a manager have had all that was sent so far: they answer what comes after it."""
        for server in ("generation", "realizer"):
            self.ask(f"{server}/manager/alice/cancel", type="cancel", id=f"settle-{next(self._numbers)}")

    def ask(self, where: str, **content: object) -> None:
        """Command as alice, again and again until there is an answer, as a program of others should."""
        for _ in range(int(PATIENCE / AGAIN)):
            self.command(self.alice, where, **content)
            if self.holds(lambda: self.answers(str(content["id"])), AGAIN):
                return
        raise AssertionError(f"{content} was not answered: {[message for _, message, _ in self.seen[-20:]]}")

    def command(self, session: zenoh.Session, where: str, **content: object) -> None:
        # Else Zenoh drops what cannot leave within a millisecond, as on a busy machine.
        block = zenoh.CongestionControl.BLOCK
        key = f"{keys.PREFIX}/cmd/{where}"
        session.put(key, json.dumps(content), encoding="application/json", congestion_control=block)

    def wait(self, holds: Any, what: str) -> None:
        """Wait until this is true of what was seen; the witness hears on another thread."""
        if not self.holds(holds, PATIENCE):
            raise AssertionError(f"{what} did not come: {[message for _, message, _ in self.seen[-20:]]}")

    def holds(self, holds: Any, patience: float) -> bool:
        """Tell whether this comes true within some seconds. Looks every 20 ms."""
        for _ in range(int(patience / 0.02)):
            if holds():
                return True
            select.select([], [], [], 0.02)
        return False

    def logged(self, *words: str) -> None:
        """Wait for a line in the log of the services with all these words."""

        def is_there() -> bool:
            lines = self.log.read_text().splitlines()
            return any(all(word in line for word in words) for line in lines)

        self.wait(is_there, " ".join(words))

    def answers(self, id: str) -> list[Message]:
        """What servers have said of a request or block."""
        return [message for _, message, _ in self.seen if id in (getattr(message, "id", ""), _block(message))]

    def certificate(
        self, folder: Path, common_name: str, begins: timedelta, ends: timedelta, own: bool = False
    ) -> Path:
        """Keys in another folder, from our authority or, if `own`, from one that somebody has made."""
        folder.mkdir()
        key, now = ec.generate_private_key(ec.SECP256R1()), datetime.now(UTC)
        authority, signing = self.authority
        if own:
            signing = ec.generate_private_key(ec.SECP256R1())
        builder = (
            x509.CertificateBuilder()
            .subject_name(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)]))
            .issuer_name(authority.subject)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(now + begins)
            .not_valid_after(now + ends)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.CLIENT_AUTH]), critical=False)
        )
        form = (serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
        (folder / "certificate.pem").write_bytes(builder.sign(signing, hashes.SHA256()).public_bytes(PEM))
        (folder / "private.pem").write_bytes(key.private_bytes(PEM, *form))
        return folder


_OWN = (("certificate", "certificate.pem"), ("private_key", "private.pem"))


def _block(message: Message) -> str:
    return str(getattr(message, "block", "") or getattr(message, "fragment", ""))
