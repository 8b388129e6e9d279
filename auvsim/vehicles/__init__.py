"""The models in models/: loading vehicles and docks, and their actuation."""
