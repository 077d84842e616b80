"""The body that is shown where there is no character: a skinned mesh around the joints of any skeleton."""
