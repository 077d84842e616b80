"""Where Blender has the bones of files: `bone_heads_m`; the file is also the script that Blender runs.

python heads_in_blender.py -- FRAMES.json HEADS.json FILE …      FRAMES: {"frames": […], "fps": …}
"""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path


def bone_heads_m(paths: Sequence[Path], frames: Sequence[int], fps: float, folder: Path) -> dict[str, dict]:
    """Heads of bones by the file's name and the bone's, lists (T, 3), world, Y up; frames count from 0."""
    from choreograph.formats.fbx import find_blender

    (folder / "frames.json").write_text(json.dumps({"frames": [int(frame) for frame in frames], "fps": fps}))
    words = [__file__, "--", folder / "frames.json", folder / "heads.json", *paths]
    command = [*(find_blender() or ()), *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert (folder / "heads.json").exists(), done.stdout + done.stderr
    return json.loads((folder / "heads.json").read_text())


def _look() -> None:
    import bpy

    asked, target, *paths = sys.argv[sys.argv.index("--") + 1 :]
    job, heads = json.loads(Path(asked).read_text()), {}
    for path in paths:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        scene.render.fps = round(job["fps"])
        suffix = Path(path).suffix.lower()
        if suffix == ".bvh":
            bpy.ops.import_anim.bvh(filepath=path, global_scale=0.01)
        elif suffix == ".fbx":
            bpy.ops.import_scene.fbx(filepath=path)
        elif suffix in (".usda", ".usdc"):
            bpy.ops.wm.usd_import(filepath=path)
        else:
            bpy.ops.import_scene.gltf(filepath=path)
        body = next(each for each in bpy.data.objects if each.type == "ARMATURE")
        first = 1 if suffix in (".bvh", ".fbx") else 0  # as Blender's importers count
        found: dict[str, list] = {bone.name: [] for bone in body.pose.bones}
        for frame in job["frames"]:
            scene.frame_set(first + frame)
            for bone in body.pose.bones:
                x, y, z = body.matrix_world @ bone.head
                found[bone.name].append([x, z, -y])
        heads[Path(path).name] = found
    Path(target).write_text(json.dumps(heads))


if __name__ == "__main__":
    _look()
