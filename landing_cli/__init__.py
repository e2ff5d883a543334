"""Where on an asteroid a spacecraft can land, and how it flies there."""

from landing_cli.compile_cache import use_own_cache

__version__ = "0.1.0"

use_own_cache()
