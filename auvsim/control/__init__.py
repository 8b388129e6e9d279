"""Control: from setpoints to actuator commands."""
