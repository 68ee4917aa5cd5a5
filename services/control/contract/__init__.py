"""The contract of a body, and what any body may use with it. No file here knows a driver."""
