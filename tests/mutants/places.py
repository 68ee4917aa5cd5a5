"""Where the map of lines and tests is kept, in build/."""

MAP = "build/mutants/lines.sqlite"
"""What coverage has written: each line of services and schemas, and the test files that run it."""

SECONDS = "build/mutants/seconds.json"
"""How long each test file took when the map was made, seconds."""
