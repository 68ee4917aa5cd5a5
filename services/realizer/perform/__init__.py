"""Live blocks on the event loop."""
