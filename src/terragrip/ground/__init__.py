"""The ground along a drive: where it changes, what it is, and what happened on it."""
