"""Views of a dance: page, video, pose strip and plots, drawn without a GPU."""
