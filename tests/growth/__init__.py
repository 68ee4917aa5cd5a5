"""One law over all that runs long: nothing grows with what is over."""
