"""Chains in time: ticks, methods, runs."""
