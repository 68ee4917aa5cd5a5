"""Certificates with which a window speaks TLS: browsers give a microphone to `https` and to this machine only."""

import os
import ssl
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.keyring import CERTIFICATE, PRIVATE
from engage_hri.services.runtime.installation import extra_command


class ServerKeys(NamedTuple):
    """Files of a server. certificate: with those that vouch for it. private: its key; may be in the same file."""

    certificate: Path
    private: Path


def server_keys(path: Path, hosts: Iterable[str]) -> ServerKeys:
    """Find the certificate of a window, and its key. Raises InputRefused.

    path: a folder with both, as `engage keys` makes them for a router; or a file with both, which is made if there is
    none. hosts: names and addresses under which the window is reached, for one that is made.
    """
    found = ServerKeys(path / CERTIFICATE, path / PRIVATE) if path.is_dir() else ServerKeys(path, path)
    try:
        if not path.exists():
            _make(path, hosts)
        if os.name == "posix" and found.private.stat().st_mode & 0o077:
            advice = f"chmod 600 {found.private}"
            raise InputRefused(
                Fault(reason="others may read the private key", where=str(found.private), advice=advice)
            )
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*found, password=lambda: "")  # else it would ask at the terminal
    except OSError as error:  # of ssl, too
        advice = "a PEM file with a certificate and its key without a password, or the folder of a router's keys"
        reason = f"no certificate with its key: {error.strerror or error}"
        raise InputRefused(Fault(reason=reason, where=str(path), advice=advice)) from error
    return found


def _make(path: Path, hosts: Iterable[str]) -> None:
    if find_spec("cryptography") is None:
        advice = f"{extra_command('keys')}; or name a file with a certificate and its key"
        reason = "there is no such file, and none can be made without the package `cryptography`"
        raise InputRefused(Fault(reason=reason, where=str(path), advice=advice))
    from engage_hri.services.bus.certificates import write_own

    write_own(path, hosts)
