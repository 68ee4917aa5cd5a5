"""The voice of the simulated body: a time line of words, and speech under a movement authority."""
