# SPDX-License-Identifier: GPL-3.0-or-later
"""What stops a dance."""


class DanceError(Exception):
    """One line for the user: expected, got, likely cause."""
