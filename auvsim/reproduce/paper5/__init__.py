"""Paper 5: navigation by Bayes filtering of imaging sonar frames, on the paper's synthetic frames and ray-cast ones."""
