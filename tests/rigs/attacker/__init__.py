"""Attackers of a robot: holders of keys and strangers who send too much, beside a manager who performs."""
