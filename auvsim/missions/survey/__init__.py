"""Surveys: lanes at an altitude over the sea floor between a fix at the surface and the dock."""
