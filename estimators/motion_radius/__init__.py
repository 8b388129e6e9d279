"""Ranges to a vehicle that navigates well, in an unknown current: the filter of paper 2 and those that replace it."""
