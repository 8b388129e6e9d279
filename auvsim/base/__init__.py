"""The ground that every package stands on: errors, settings, files, frames, random streams."""
