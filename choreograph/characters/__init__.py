"""Characters of users: finds their bones and retargets dances to them."""
