"""Long requests: two pure machines, the tables that they follow, and both ends on the bus."""
