"""File for the result of a command."""

import os
from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed


class ResultFile:
    """File for a result. Raises InputRefused if it cannot be written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        folder, reason = path.parent, ""
        if path.is_dir():
            reason = "is a folder"
        elif not folder.is_dir():
            reason = f"there is no folder {folder}"
        elif not os.access(path if path.exists() else folder, os.W_OK):
            reason = "cannot be written"
        if reason:
            raise InputRefused(Fault(reason=reason, where=str(path)))

    def write(self, content: bytes) -> None:
        """Write the whole. Raises RunFailed."""
        try:
            self.path.write_bytes(content)
        except OSError as error:
            raise RunFailed(Fault(reason=f"cannot write: {error.strerror}", where=str(self.path))) from error
