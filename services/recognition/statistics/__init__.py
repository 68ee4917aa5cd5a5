"""What connection events say in numbers."""
