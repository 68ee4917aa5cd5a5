"""Long requests: two pure state machines, the tables that they follow, and both ends on the bus."""
