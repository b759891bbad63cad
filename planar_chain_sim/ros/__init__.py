"""All that needs ROS 2: the node, its topics and parameters, and replay."""
