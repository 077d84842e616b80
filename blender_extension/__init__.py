# SPDX-License-Identifier: GPL-3.0-or-later
"""Choreograph in Blender: animates an armature to a song with the installed program `choreograph`."""

from . import operators, panel, settings


def register() -> None:
    for module in (settings, operators, panel):
        module.register()


def unregister() -> None:
    for module in (panel, operators, settings):
        module.unregister()
