"""Connection events from actions: one state machine for each kind, one set of them for each person."""
