"""From a fragment and what the policies chose to a block."""
