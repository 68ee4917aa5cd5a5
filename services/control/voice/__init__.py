"""When words are said: a model of a voice, and speech under an authority."""
