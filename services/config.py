"""One configuration for all services: TOML in, frozen structs out. A bad one is refused at start, by key."""

from pathlib import Path

import msgspec
from msgspec import Struct

from schemas.faults import Fault, InputRefused


class Config(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """robot: the namespace on the bus and the robot's actor id. Each service adds its own section here."""

    robot: str = "robot"


def load(path: Path) -> Config:
    """Read a TOML file. Raises InputRefused with the file and the key that is wrong."""
    try:
        return msgspec.toml.decode(path.read_bytes(), type=Config)
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(path))) from error
    except msgspec.DecodeError as error:
        raise InputRefused(Fault(reason=str(error), where=str(path), advice="see docs/configuration.md")) from error
