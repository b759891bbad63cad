"""Benchmarks that anyone can run again: `benchmark step-time` (the kernel) and `benchmark node` (the ROS 2 node)."""
