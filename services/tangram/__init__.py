"""The tangram table of the anchor study: its pieces and where they lie."""
