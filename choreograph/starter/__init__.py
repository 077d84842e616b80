"""The built-in repertoire: songs and takes the project makes itself."""
