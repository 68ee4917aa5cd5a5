"""The simulated person and table: they look, speak and move pieces as the anchor study saw people do."""
