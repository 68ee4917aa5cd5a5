"""Settings of the door: where it listens, and who comes in."""

from typing import Literal

from msgspec import Struct

DoorRole = Literal["observer", "manager", "operator", "wizard"]


class DoorConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of the door. Raises ValueError if out of range."""

    host: str = "127.0.0.1"
    """Address on which it listens; others than this machine's let other machines try."""
    port: int = 8138
    """Port; 0: any that is free, which is told."""
    roles: tuple[DoorRole, ...] = ("observer", "manager")
    """Roles for which there is a token: what each may do is as on the bus."""
    folder: str = "door-tokens"
    """Folder with a file for each role, named after it, that holds its token; what is missing is made."""
    https: str = ""
    """File with a certificate and its key, made if there is none, or the folder of a router's keys; empty: no TLS."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65535:
            raise ValueError(f"port must be 0 to 65535, not {self.port}")
