"""Commands for studies: simulated and recorded sessions, and what is counted in them."""
