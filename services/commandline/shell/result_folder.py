"""Places for results: checked before any work is done for them. In a folder each is written whole or not at all."""

import os
from collections.abc import Collection
from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed


class Folder:
    """Directory for results. names: of all files that may be written. overwrite: old ones are replaced or removed.

    Raises InputRefused if the directory cannot be written to, or, without `overwrite`, holds one of the files.
    """

    def __init__(self, path: Path, names: Collection[str], *, overwrite: bool) -> None:
        self.path = path
        self._names = names
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot be made: {error.strerror}", where=str(path))) from error
        if not os.access(path, os.W_OK | os.X_OK):
            raise InputRefused(Fault(reason="cannot be written to", where=str(path)))
        present = [name for name in names if (path / name).exists()]
        if present and not overwrite:
            raise InputRefused(
                Fault(reason=f"has results already: {', '.join(present)}", where=str(path), advice="add --overwrite")
            )

    def write(self, files: dict[str, bytes]) -> None:
        """Write these files, and remove the others of `names`. Raises RunFailed."""
        for name in self._names:
            try:
                if name in files:
                    part = self.path / f".{name}.part"
                    part.write_bytes(files[name])
                    part.replace(self.path / name)
                else:
                    (self.path / name).unlink(missing_ok=True)
            except OSError as error:
                fault = Fault(reason=f"cannot write: {error.strerror}", where=str(self.path / name))
                raise RunFailed(fault) from error


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
