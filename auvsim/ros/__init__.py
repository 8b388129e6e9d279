"""Recordings of ROS 2: message types, frames, and files of messages (MCAP, rosbag2) as arrays."""
