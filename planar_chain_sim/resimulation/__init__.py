"""A run computed again: bit for bit, or on another chain, by another method or step; logs and bags."""
