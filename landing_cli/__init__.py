"""Where on an asteroid a spacecraft can land, and how it flies there."""

__version__ = "0.1.0"
