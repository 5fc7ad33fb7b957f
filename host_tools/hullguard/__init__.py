"""Event-triggered, set-based fault detection on ECUs over CAN: the host side."""

__version__ = "0.1.0"
