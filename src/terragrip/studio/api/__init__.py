"""The studio's REST and WebSocket routes, a module a page or subject."""
