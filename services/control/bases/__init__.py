"""Bodies to build on: of one part, composed of several, and how drivers are found and guarded."""
