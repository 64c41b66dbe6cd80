"""Advice: from the curve of the ground and the vehicle to slip, speed, load and ballast, and to set-points of slip."""
