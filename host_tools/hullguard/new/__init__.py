"""A first model file."""
