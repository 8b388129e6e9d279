"""Process models and sensors of any vehicle, by composition."""
