"""The addresses of the studio, a module for each concern."""
