"""Sources of landmarks, each one file: what turns pictures into points."""
