"""Eyes: from pictures to who is there, where their heads point, and nods. docs/eyes.md tells how to use it."""
