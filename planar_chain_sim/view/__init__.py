"""The page in the browser: a live robot, a chain that is simulated here, or a log."""
