"""Tokens: who has one takes part. Each is random, and may be kept in a file (docs/decisions/0090)."""

import os
import re
import secrets
from contextlib import suppress
from functools import partial
from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused, raised_as

TOKEN = 12
"""Bytes of chance in a token."""


def new_token() -> str:
    """Make a token."""
    return secrets.token_urlsafe(TOKEN)


def is_token(given: str, token: str) -> bool:
    """Tell whether this is the token, in a time that tells nothing of it."""
    return secrets.compare_digest(given.encode(), token.encode())


def kept_token(path: Path) -> str:
    """The token in a file, which is made for its owner alone if there is none. Raises InputRefused.

    On the command line, every user of the machine could read it.
    """
    with raised_as(InputRefused, (OSError, UnicodeDecodeError), path, "cannot be read or made"):
        with suppress(FileExistsError), open(path, "x", opener=partial(os.open, mode=0o600)) as file:
            file.write(f"{new_token()}\n")
        token, mode = path.read_text(encoding="utf-8").strip(), path.stat().st_mode
    if os.name == "posix" and mode & 0o077:
        raise InputRefused(Fault(reason="others may read it", where=str(path), advice=f"chmod 600 {path}"))
    if not re.fullmatch(r"[\w-]{12,}", token, re.ASCII):
        reason = "this is no token: at least 12 letters, digits, - and _, on one line"
        raise InputRefused(Fault(reason=reason, where=str(path), advice="name a new file, and it is made"))
    return token
