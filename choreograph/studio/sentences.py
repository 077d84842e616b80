"""What each cost means, in one sentence for a page."""

from __future__ import annotations

from typing import Any

from choreograph.settings import DEFAULT_WEIGHTS

_HIGHEST = 4.0  # of a slider, in units of the default weight

# Of the graph engine: what a dance pays for.
OF_DANCE = {
    "genre": "The style of the take differs from that of the music.",
    "completeness": "The take is left before its movement is complete.",
    "transition": "The poses differ where one take follows another.",
    "velocity": "The speeds of the joints differ where one take follows another.",
    "rhythm": "Motion beats miss the beats of the music.",
    "pace": "The take is played faster or slower than it was danced.",
    "front": "The dancer turns away from the audience.",
    "seed": "A random preference, which another seed changes.",
    "variety": "The same take was danced shortly before.",
    "repeat": "The take jumps back to what was just danced.",
    "signature": "The motifs differ from those that were asked for.",
    "motif_transition": "These motifs rarely follow each other in the takes.",
    "accents": "Motion beats are not on the counts.",
    "bars": "Count 1 of the take is not on count 1 of the music.",
    "phrasing": "The take changes inside of a figure or a bar.",
    "energy": "The motion is larger or smaller than the music is loud.",
    "steps": "There are more or fewer steps than the music has onsets.",
    "stillness": "The dancer stands still where the music goes on.",
    "form": "A phrase that returns in the music is danced in another way.",
    "stage": "The dancer leaves the stage.",
    "constraints": "The take is not of the genre that is likely here.",
}
# Of pieces of takes for a part of a dance, in metres of joint distance.
OF_PIECE = {
    "joins": "The poses at both ends differ from the dance around it.",
    "travel": "The path must be corrected to lead back to the dance.",
    "front": "It begins with the back to the audience.",
    "tempo": "It is played faster or slower than it was danced.",
    "count": "It begins on another count of the bar.",
    "genre": "It is of another genre than the dance has here.",
    "energy": "It is livelier or quieter than the dance was here.",
    "again": "The same part of a take is danced nearby.",
    "difference": "It differs from what was danced here.",
}


def weight_choices() -> list[dict[str, Any]]:
    """A slider for the weight of each cost of the graph engine."""
    return [
        {"name": name, "default": default, "low": 0.0, "high": max(_HIGHEST * default, 1.0),
         "sentence": OF_DANCE[name]}
        for name, default in DEFAULT_WEIGHTS.items()
    ]  # fmt: skip
