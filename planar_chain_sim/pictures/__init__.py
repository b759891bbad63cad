"""Pictures of a motion and of a log."""
