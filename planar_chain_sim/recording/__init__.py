"""Recording with no ROS installed: CDR bytes, message definitions, the MCAP log's writer and reader."""
