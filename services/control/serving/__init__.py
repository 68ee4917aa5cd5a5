"""The service that puts a body on the bus: what is asked of it, what it tells, and what people see it do."""
