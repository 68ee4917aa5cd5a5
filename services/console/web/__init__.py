"""The window: a page in the browser that shows a robot, and lets people with the right to it take part."""
