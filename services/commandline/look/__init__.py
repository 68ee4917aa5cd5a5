"""Commands that show a robot: in a terminal, in a browser, and the demonstration."""
