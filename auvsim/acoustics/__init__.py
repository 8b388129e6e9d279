"""Acoustics: links with delay and loss, and the dock's USBL service."""
