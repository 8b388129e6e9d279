"""Paper 2: a follower in an unknown current bounds its error by ranges to a leader that navigates well."""
