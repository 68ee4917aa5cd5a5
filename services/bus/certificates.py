"""Certificates of the holders of keys, and of the authority that gives them. Needs the package `cryptography`."""

import os
import re
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric.ec import SECP256R1, EllipticCurvePrivateKey, generate_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from engage_hri.schemas.access import PARTICIPANTS, ROLES, ROUTER, Holder
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.keys import CHUNK, is_chunk
from engage_hri.services.bus.keyring import AUTHORITY, CERTIFICATE, HOLDERS, PRIVATE, WHO, Who

SECRET = "ca.private.pem"
"""Private key of the authority. Whoever has it can give out certificates: it belongs on no robot."""
STANDARD = {
    **PARTICIPANTS, "manager": "manager", "viewer": "observer", "up": "observer", "operator": "operator",
    "wizard": "wizard", ROUTER: ROUTER,
}  # fmt: skip
"""Roles of the holders that every robot has, by their names."""
EARLIER = timedelta(hours=1)
"""How long before now a certificate begins, as the clocks of other machines may be late."""
AUTHORITY_DAYS = 3650
HERE = ("localhost", "127.0.0.1", "::1")
"""Names and addresses of a router on the same machine."""
_HOST = re.compile(r"[A-Za-z0-9_*]([A-Za-z0-9_.-]*[A-Za-z0-9_])?")


OWN_DAYS = 825
"""Days for which a server's own certificate is valid: browsers take none that is valid for longer."""


class Shown(NamedTuple):
    """A certificate that is in a folder. is_revoked: routers that have the list of this folder do not let it in."""

    name: str
    common_name: str
    until: datetime
    is_revoked: bool = False


def initialize(folder: Path, robot: str, holders: Sequence[tuple[str, str]], hosts: Iterable[str], days: int) -> None:
    """Make an authority, and keys for the standard holders and these. Raises InputRefused if there is one already.

    holders: role and name of each. hosts: names and addresses under which the router is reached.
    """
    wanted = {**{name: role for role, name in holders}, **STANDARD}
    every = [Holder(robot=robot, role=role, name=name) for name, role in wanted.items()]
    for position, (role, name) in enumerate(holders):
        _check(role, name, (*STANDARD, *(other for _, other in holders[:position])))
    for holder in every:
        _check_length(holder)
    addresses = _alternatives((*HERE, *hosts))
    if any([(folder / AUTHORITY).exists(), (folder / SECRET).exists(), *folder.glob(f"*/{PRIVATE}")]):
        raise InputRefused(
            Fault(reason="there are keys already", where=str(folder), advice="`engage keys add` gives out more")
        )
    folder.mkdir(parents=True, exist_ok=True)
    key = generate_private_key(SECP256R1())
    itself = _name(f"{robot}/authority")
    usage = x509.KeyUsage(
        digital_signature=False, content_commitment=False, key_encipherment=False, data_encipherment=False,
        key_agreement=False, key_cert_sign=True, crl_sign=True, encipher_only=False, decipher_only=False,
    )  # fmt: skip
    certificate = (
        _builder(itself, itself, key, AUTHORITY_DAYS)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(usage, critical=True)
        .sign(key, hashes.SHA256())
    )
    _write(folder / SECRET, _private(key), 0o600)
    _write(folder / AUTHORITY, certificate.public_bytes(serialization.Encoding.PEM), 0o644)
    for holder in every:
        _give(folder, holder, generate_private_key(SECP256R1()), days, addresses if holder.role == ROUTER else None)
    _let_in(folder, every)


def write_own(path: Path, hosts: Iterable[str]) -> None:
    """Write a server's own certificate, for which nobody else vouches, and its private key into one file.

    hosts: names and addresses under which it is reached, besides those of its own machine. Raises InputRefused for
    one that is none, and OSError.
    """
    key, itself = generate_private_key(SECP256R1()), _name("Engage window")
    certificate = (
        _builder(itself, itself, key, OWN_DAYS)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(_alternatives((*HERE, *hosts)), critical=False)
        .sign(key, hashes.SHA256())
    )
    _write(path, certificate.public_bytes(serialization.Encoding.PEM) + _private(key), 0o600)


def add(folder: Path, holders: Sequence[tuple[str, str]], days: int) -> None:
    """Give keys to more holders. Raises InputRefused for a name that is taken."""
    robot = _read_holder(folder / ROUTER).robot
    for position, (role, name) in enumerate(holders):
        _check(role, name, (*_there(folder), *(other for _, other in holders[:position])))
        _check_length(Holder(robot=robot, role=role, name=name))
    for role, name in holders:
        _give(folder, Holder(robot=robot, role=role, name=name), generate_private_key(SECP256R1()), days, None)
    _let_in(folder, [*_let_in_before(folder), *(Holder(robot=robot, role=role, name=name) for role, name in holders)])


def renew(folder: Path, names: Sequence[str], days: int) -> None:
    """Give new certificates, for the same private keys, to these holders, or to all. Raises InputRefused."""
    there = _there(folder)
    for name in names:
        if name not in there:
            raise InputRefused(Fault(reason=f"no keys of {name!r}", where=str(folder), advice=", ".join(there)))
    for name in names or there:
        place = folder / name
        key = _load_key(place / PRIVATE)
        try:
            old = _load(place / CERTIFICATE).extensions.get_extension_for_class(x509.SubjectAlternativeName)
        except x509.ExtensionNotFound:
            _give(folder, _read_holder(place), key, days, None)
        else:
            _give(folder, _read_holder(place), key, days, old.value)


def revoke(folder: Path, names: Sequence[str]) -> None:
    """Let these holders in no more, once the routers have the list anew. Raises InputRefused."""
    before = _let_in_before(folder)
    known = [holder.name for holder in before]
    for name in names:
        if name not in known or name == ROUTER:
            raise InputRefused(Fault(reason=f"{name!r} is not let in", where=str(folder), advice=", ".join(known)))
    _let_in(folder, [holder for holder in before if holder.name not in names])


def shown(folder: Path) -> list[Shown]:
    """Read all certificates in a folder, the next to expire first, those that were revoked last. Raises InputRefused.

    On a machine without the router's folder nobody knows who was revoked, and none is told to be.
    """
    places = [folder] if (folder / CERTIFICATE).exists() else [folder / name for name in _there(folder)]
    above = folder.parent if places == [folder] else folder
    is_known = (above / ROUTER / HOLDERS).exists()
    let_in = {holder.common_name for holder in _let_in_before(above)} if is_known else set()
    listed = []
    for place in places:
        certificate = _load(place / CERTIFICATE)
        name = _common_name(certificate)
        listed.append(Shown(place.name, name, certificate.not_valid_after_utc, is_known and name not in let_in))
    if (folder / AUTHORITY).exists() and places != [folder]:
        authority = _load(folder / AUTHORITY)
        listed.append(Shown("(authority)", _common_name(authority), authority.not_valid_after_utc))
    return sorted(listed, key=lambda each: (each.is_revoked, each.until, each.name))


def let_in(folder: Path) -> tuple[Holder, ...]:
    """Read to whom a router gives access. folder: that of all keys, or the router's. Raises InputRefused."""
    return tuple(_let_in_before(folder if (folder / ROUTER).exists() else folder.parent))


def _give(
    folder: Path,
    holder: Holder,
    key: EllipticCurvePrivateKey,
    days: int,
    addresses: x509.SubjectAlternativeName | None,
) -> None:
    """Write the keys of a holder. addresses: those of a router, who alone may be called by others."""
    signing, authority = _load_key(folder / SECRET), _load(folder / AUTHORITY)
    purposes = [ExtendedKeyUsageOID.CLIENT_AUTH, *([ExtendedKeyUsageOID.SERVER_AUTH] if addresses else [])]
    builder = (
        _builder(_name(holder.common_name), authority.subject, key, days)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage(purposes), critical=False)
    )
    if addresses is not None:
        builder = builder.add_extension(addresses, critical=False)
    certificate = builder.sign(signing, hashes.SHA256())
    place = folder / holder.name
    place.mkdir(mode=0o700, exist_ok=True)
    who = Who(
        robot=holder.robot, role=holder.role, name=holder.name, until=int(certificate.not_valid_after_utc.timestamp())
    )
    _write(place / PRIVATE, _private(key), 0o600)
    _write(place / CERTIFICATE, certificate.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(place / AUTHORITY, authority.public_bytes(serialization.Encoding.PEM), 0o644)
    _write(place / WHO, msgspec.json.encode(who) + b"\n", 0o644)


def _builder(
    subject: x509.Name, issuer: x509.Name, key: EllipticCurvePrivateKey, days: int
) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - EARLIER)
        .not_valid_after(now + timedelta(days=days))
    )


def _check(role: str, name: str, taken: Sequence[str]) -> None:
    """Check a new holder. Names must tell apart whose participant one is: `a-b` may be one of holder `a`."""
    if role not in ROLES or role in PARTICIPANTS:
        free = ", ".join(each for each in ROLES if each not in PARTICIPANTS)
        raise InputRefused(Fault(reason=f"no role {role!r} to give out", where=f"{role}={name}", advice=free))
    if not is_chunk(name) or not name.isascii() or not name.isprintable() or name in (".", "..") or " " in name:
        raise InputRefused(Fault(reason=f"{name!r} can't be in a key", where=f"{role}={name}", advice=CHUNK))
    for other in taken:
        if name == other or name.startswith(f"{other}-") or other.startswith(f"{name}-"):
            reason = f"the name is taken: keys of {other!r} are for participants that are called so, or `{other}-...`"
            raise InputRefused(Fault(reason=reason, where=f"{role}={name}"))


def _check_length(holder: Holder) -> None:
    if len(holder.common_name.encode()) > 64:
        reason = f"{holder.common_name!r} is too long for a certificate: 64 bytes"
        raise InputRefused(Fault(reason=reason, where=holder.name))


def _alternatives(hosts: Iterable[str]) -> x509.SubjectAlternativeName:
    names: list[x509.GeneralName] = []
    for host in dict.fromkeys(hosts):
        try:
            names.append(x509.IPAddress(ip_address(host)))
        except ValueError:
            names.append(x509.DNSName(_checked_host(host)))
    return x509.SubjectAlternativeName(names)


def _checked_host(host: str) -> str:
    if _HOST.fullmatch(host):
        return host
    advice = "the name or the address under which the router is called, without a port"
    raise InputRefused(Fault(reason=f"{host!r} is no host", where="--host", advice=advice))


def _name(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _common_name(certificate: x509.Certificate) -> str:
    return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)


def _private(key: EllipticCurvePrivateKey) -> bytes:
    return key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )


def _write(path: Path, content: bytes, mode: int) -> None:
    """Write a file that others than we may read only if `mode` says so, from its first byte on."""
    made = path.with_name(f".{path.name}.new")
    made.unlink(missing_ok=True)
    with open(os.open(made, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(content)
    made.replace(path)


def _there(folder: Path) -> tuple[str, ...]:
    names = tuple(sorted(each.parent.name for each in folder.glob(f"*/{CERTIFICATE}")))
    if not names:
        raise InputRefused(Fault(reason="no keys here", where=str(folder), advice="`engage keys init` makes some"))
    return names


def _let_in_before(folder: Path) -> list[Holder]:
    return _decoded(folder / ROUTER / HOLDERS, list[Holder])  # type: ignore[no-any-return]


def _let_in(folder: Path, holders: Iterable[Holder]) -> None:
    listed = msgspec.json.format(msgspec.json.encode(list(holders)))
    _write(folder / ROUTER / HOLDERS, listed + b"\n", 0o644)


def _read_holder(place: Path) -> Holder:
    who = _decoded(place / WHO, Who)
    return Holder(robot=who.robot, role=who.role, name=who.name)


def _decoded(path: Path, kind: object) -> Any:
    with raised_as(InputRefused, (msgspec.DecodeError, UnicodeDecodeError), path, "damaged"):
        return msgspec.json.decode(_read(path), type=kind)


def _load(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(_read(path))
    except ValueError as error:
        raise InputRefused(Fault(reason="no certificate", where=str(path))) from error


def _load_key(path: Path) -> EllipticCurvePrivateKey:
    try:
        key = serialization.load_pem_private_key(_read(path), None)
    except (ValueError, TypeError) as error:
        raise InputRefused(Fault(reason="no private key", where=str(path))) from error
    if not isinstance(key, EllipticCurvePrivateKey):
        raise InputRefused(Fault(reason="a private key of another kind than ours", where=str(path)))
    return key


def _read(path: Path) -> bytes:
    advice = "it is where `engage keys init` was called" if path.name == SECRET else "`engage keys init` makes it"
    with raised_as(InputRefused, OSError, path, advice=advice):
        return path.read_bytes()
