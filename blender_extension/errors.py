# SPDX-License-Identifier: GPL-3.0-or-later
"""The error of the extension."""


class DanceError(Exception):
    """No dance can be made. The message is one line for the user: expected, got, likely cause."""
