"""Grounds distinguished from any recording, window by window: `classifier.GroundClassifier` and its parts."""
