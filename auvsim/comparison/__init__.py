"""A log beside the simulation: a vehicle's model driven by the log's rudder and shaft, and what tells them apart."""
