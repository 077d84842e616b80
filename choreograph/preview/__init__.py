"""The dance to look at: a shaded figure of any skeleton, as pictures, strips and videos, without a GPU."""
