"""A conversation of a robot with people, led by a model: its history, its tools, its words as they are written."""
