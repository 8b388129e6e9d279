"""The planar model of a rudder-driven vehicle and its noise."""
