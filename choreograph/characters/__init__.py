"""Characters of the user's: their bones found and a dance brought onto them."""
