"""The repertoire of a configuration, with the files that it names. Reads them."""

from pathlib import Path

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.utf8 import utf8
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire, extended


def repertoire_of(config: ControlConfig) -> Repertoire:
    """The repertoire with what the files of the configuration add to it. Raises InputRefused."""
    return extended(BUILT_IN, [(file, _read(file)) for file in config.repertoire_files])


def _read(file: str) -> str:
    try:
        return utf8(Path(file).read_bytes(), file)
    except OSError as error:
        advice = "it is in `control.repertoire`; a relative path counts from the folder of the process"
        raise InputRefused(Fault(reason=error.strerror or str(error), where=file, advice=advice)) from error
