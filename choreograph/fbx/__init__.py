"""FBX files, by way of Blender in a process of its own: no other free program writes them well."""

from choreograph.fbx.conversion import convert, find_blender, require_blender

__all__ = ["convert", "find_blender", "require_blender"]
