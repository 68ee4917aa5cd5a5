"""From actions to connection events: one state machine for each kind, one set of them for each person."""
