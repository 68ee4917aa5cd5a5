"""A source of pieces at work for the service, as those of eyes are:

    python -m engage_hri.services.perception.pieces.watching

is its process.
"""

from engage_hri.services.perception.eyes.watching import SourceKind, main
from engage_hri.services.perception.pieces.spotting import SpottedPieces, TableSettings
from engage_hri.services.runtime.installation import PIECES

TABLES_SEEN = SourceKind(
    PIECES, TableSettings, SpottedPieces, "engage_hri.services.perception.pieces.watching", "pieces.source"
)
"""Sources of pieces."""

if __name__ == "__main__":
    main(TABLES_SEEN)
