"""A router, four processes that hear one another, a flood: processes stand still, links are cut."""
