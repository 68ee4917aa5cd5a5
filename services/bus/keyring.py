"""Folders of keys, as a process of the bus reads them. `engage keys` makes them.

A folder holds what one holder needs: its certificate with its private key, the certificate of the authority that all
trust, and who it is. The folder above, with the folders of several holders, will do as well where a process knows
whose keys it is to take.

A link ends with the certificate at either end, and there is no other. So its end is told ahead (`Expiry`).
"""

import asyncio
import ssl
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas.access import Holder
from engage_hri.schemas.faults import Fault, InputRefused, NotReady, raised_as
from engage_hri.schemas.units import A_DAY, Seconds, span

AUTHORITY, CERTIFICATE, PRIVATE, WHO, HOLDERS = (
    "ca.pem",
    "certificate.pem",
    "private.pem",
    "holder.json",
    "holders.json",
)
"""Files of a folder. `HOLDERS` is a router's: to whom it gives access."""
_ADVICE = "`engage keys init` makes such folders"


class Who(Holder, frozen=True, kw_only=True):
    """A holder, and until when its certificate is valid, in seconds since 1970."""

    until: int


class Keys(Struct, frozen=True):
    """Keys of one holder."""

    folder: Path
    holder: Who

    @property
    def authority(self) -> str:
        return str(self.folder / AUTHORITY)

    @property
    def certificate(self) -> str:
        return str(self.folder / CERTIFICATE)

    @property
    def private(self) -> str:
        return str(self.folder / PRIVATE)

    def holders(self) -> tuple[Holder, ...]:
        """Read to whom this router gives access. Raises InputRefused."""
        return tuple(_read(self.folder / HOLDERS, tuple[Holder, ...]))


def read_keys(folder: str | Path, name: str) -> Keys:
    """Read keys: those in the folder, or those of holder `name` in a folder within. Raises InputRefused."""
    place = Path(folder)
    if not (place / WHO).exists():
        place = place / name
        if not (place / WHO).exists():
            there = sorted(each.parent.name for each in Path(folder).glob(f"*/{WHO}"))
            known = f"there are keys of {', '.join(there)}: name that folder" if there else _ADVICE
            raise NotReady(Fault(reason=f"no keys of {name!r}", where=str(folder), advice=known))
    holder = _read(place / WHO, Who)
    for file in (AUTHORITY, CERTIFICATE, PRIVATE):
        with raised_as(NotReady, OSError, place / file):
            (place / file).read_bytes()
    if mode := (place / PRIVATE).stat().st_mode & 0o077:
        reason = f"others may read this private key (mode {mode:03o} for group and others)"
        raise InputRefused(Fault(reason=reason, where=str(place / PRIVATE), advice="chmod 600"))
    if holder.until <= time.time():
        reason = f"the certificate of {holder.common_name} has expired"
        raise NotReady(Fault(reason=reason, where=str(place), advice="`engage keys renew`"))
    keys = Keys(place, holder)
    _try(keys)
    return keys


def _try(keys: Keys) -> None:
    """Use the keys once, without a network: Zenoh says of damaged ones no more than that nobody answers.

    Raises InputRefused: a file is damaged, or the three do not belong together.
    """
    server, client = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER), ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    client.check_hostname, client.verify_mode, server.verify_mode = False, ssl.CERT_NONE, ssl.CERT_REQUIRED
    steps: tuple[tuple[str, Callable[[], object]], ...] = (
        (AUTHORITY, lambda: server.load_verify_locations(keys.authority)),
        (CERTIFICATE, lambda: client.load_verify_locations(keys.certificate)),
        (PRIVATE, lambda: server.load_cert_chain(keys.certificate, keys.private, "")),
        (PRIVATE, lambda: client.load_cert_chain(keys.certificate, keys.private, "")),
        (PRIVATE, lambda: _shake_hands(server, client)),
    )
    for file, step in steps:
        try:
            step()
        except (ssl.SSLError, ValueError) as error:
            beside = f", or not of the {CERTIFICATE} beside it" if file == PRIVATE else ""
            reason, advice = f"damaged{beside}: {error}", "copy the folder anew from where `engage keys` made it"
            if isinstance(error, ssl.SSLCertVerificationError):  # one of the two, or the clock of this computer
                file, reason = CERTIFICATE, f"not accepted with the {AUTHORITY} beside it: {error.verify_message}"
            raise InputRefused(Fault(reason=reason, where=str(keys.folder / file), advice=advice)) from error


def _shake_hands(server: ssl.SSLContext, client: ssl.SSLContext) -> None:
    """Connect the two in memory. Raises ssl.SSLError."""
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    sides = client.wrap_bio(back, there), server.wrap_bio(there, back, server_side=True)
    for side in sides * 3:
        with suppress(ssl.SSLWantReadError):
            side.do_handshake()


def _read(path: Path, kind: type) -> Any:
    with raised_as(NotReady, OSError, path, advice=_ADVICE):
        text = path.read_bytes()
    with raised_as(InputRefused, (msgspec.DecodeError, UnicodeDecodeError), path, "damaged", _ADVICE):
        return msgspec.json.decode(text, type=kind)


AHEAD: tuple[Seconds, ...] = (30 * A_DAY, 7 * A_DAY, A_DAY, 0.0)
"""Times before its end at which it is told."""
LOOK: Seconds = 3600.0
"""Time after which the wall clock is read again: it may be set, and machines sleep."""
REMEDY = "`engage keys renew` where the authority is; give this process its folder anew, and start it again"


def told(left: Seconds) -> int:
    """Count the times of `AHEAD` that have been reached. left: time to the end."""
    return sum(left <= ahead for ahead in AHEAD)


def words(name: str, left: Seconds) -> str:
    """Write the line that tells of an end. left: time to it."""
    if left <= 0:
        return f"the certificate of {name} has expired: its links end, and it gets no new ones; {REMEDY}"
    return f"the certificate of {name} expires in {span(left)}, and its links end then; {REMEDY}"


class Expiry:
    """Alarm of a certificate: a line when 30 days, 7 days or a day are left, and at its end.

    wall: reads the wall clock, in seconds since 1970.
    """

    def __init__(
        self, name: str, until: float, tell: Callable[[str], None], wall: Callable[[], float] = time.time
    ) -> None:
        """name: common name of its holder. until: its end, in seconds since 1970."""
        self._name = name
        self._until = until
        self._tell = tell
        self._wall = wall
        self._told = 0
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._look()

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def _look(self) -> None:
        left = self._until - self._wall()
        if (reached := told(left)) > self._told:
            self._told = reached
            self._tell(words(self._name, left))
        ahead = [left - each for each in AHEAD if left > each]
        self._timer = self._loop.call_later(min(LOOK, *ahead), self._look) if ahead else None
