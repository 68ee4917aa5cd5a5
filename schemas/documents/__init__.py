"""What people write and read: blocks, fragments and feedback, as XML in three dialects and as JSON."""
