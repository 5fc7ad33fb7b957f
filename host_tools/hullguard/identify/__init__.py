"""Bounds of a plant from fault-free recordings."""
