# SPDX-License-Identifier: GPL-3.0-or-later
"""Choreograph in Blender: an armature dances to a song, by the program `choreograph` on this machine."""

from . import operators, panel, settings


def register() -> None:
    for module in (settings, operators, panel):
        module.register()


def unregister() -> None:
    for module in (panel, operators, settings):
        module.unregister()
