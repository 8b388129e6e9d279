"""Paper 5: navigation by Bayes filtering of imaging sonar frames, on the paper's own synthetic frames."""
