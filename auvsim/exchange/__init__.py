"""Logs for other programs: MCAP with ROS 2 messages and a Foxglove layout, CSV, and MATLAB."""
