"""The mannequin, a skinned mesh around the joints of any skeleton, which is shown without a character."""
