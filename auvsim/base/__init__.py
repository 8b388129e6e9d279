"""What every package uses: errors, settings, files, frames, random streams."""
