"""Settings of eyes: which source, and where its camera stands."""

from engage_hri.schemas.units import positive
from engage_hri.services.perception.attached import AttachedCamera

PAGE = "page"
"""Source that is no device: the cameras of those who sit at pages of windows."""


class EyesConfig(AttachedCamera, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of eyes. Raises ValueError if out of range."""

    source: str = "camera"
    """The landmarks: `camera`; `page`: the cameras of all who sit at pages of windows; `film:PATH`, a film or a
    folder of pictures; `landmarks:FILE`, those of a recording; or the name of another package's source, with a path
    behind a colon if it takes one."""
    most_faces: int = 4
    """Faces at once."""

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, ("most_faces",))
