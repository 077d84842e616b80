"""Views of a dance: page, video, pose strip and plots. No GPU is needed."""
