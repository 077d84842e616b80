"""The distance of the fitted body from the captured markers.

For every take of dance-with-melody, this is the mean distance in centimetres between joints and markers,
without the mean offset of each frame, because the floor is levelled and the path scaled. It is given for a
skeleton with the bones of the captured body (`own`), for the one skeleton of the takes with markers scaled to
its size (`sized`), and with markers as they are, where a body of another size is off by construction (`raw`).
The script also prints how many joints turn by more than 90 degrees between two frames.

    python research/marker_fit.py path/to/dance-with-melody
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from choreograph.formats import dance_with_melody as layout
from choreograph.motion.bone_map import joint_roles
from choreograph.motion.marker_fitting import BodyClusters, cluster_bodies, fit_error_m, fit_positions
from choreograph.motion.motion import Take


def raw_error_m(take: Take, pos_m: np.ndarray) -> np.ndarray:
    """Distances (T, R') between a take's joints and markers, each frame's mean offset taken away."""
    joints = joint_roles(take.motion.skeleton)
    seen = [role for role in layout.ROLES if role in joints]
    found_m = take.motion.joint_pos_m()[:, [joints[role] for role in seen]]
    off_m = pos_m[:, [layout.ROLES.index(role) for role in seen]] - found_m
    return np.linalg.norm(off_m - off_m.mean(axis=1, keepdims=True), axis=-1)


def own_error_m(bodies: BodyClusters, pos_m: np.ndarray, fps: float) -> np.ndarray:
    """Distances (T, R') between the markers and each frame's own body, fitted to them."""
    nearest = bodies.membership(pos_m, layout.ROLES, fps).argmax(axis=1)  # (T,)
    errors = np.stack(
        [
            fit_error_m(body, *fit_positions(body, pos_m, layout.ROLES, fps=fps), pos_m, layout.ROLES)
            for body in bodies.skeletons
        ]
    )  # (N, T, R')
    return errors[nearest, np.arange(len(pos_m))]


def jumps(take: Take) -> int:
    """Turns of any joint by more than 90 degrees between two frames."""
    quat = take.motion.local_quat
    half_turn = np.abs(np.sum(quat[1:] * quat[:-1], axis=-1))  # (T - 1, J) cosine of half the angle
    return int(np.sum(half_turn < np.cos(np.pi / 4)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("data", type=Path)
    data = parser.parse_args().data
    takes = layout.read(data)
    points = {
        take.name: layout.without_spikes(layout.read_points_m(data / take.name / "skeletons.json"))
        for take in takes
    }
    bodies = cluster_bodies(np.concatenate(list(points.values())), layout.ROLES, layout.N_BODIES)
    rows = []
    for take in takes:
        pos_m, fps, skeleton = points[take.name], take.motion.fps, take.motion.skeleton
        means_m = (
            own_error_m(bodies, pos_m, fps).mean(),
            layout.fit_bodies(skeleton, bodies, pos_m, fps)[2].mean(),
            raw_error_m(take, pos_m).mean(),
        )
        rows.append([*(100.0 * mean for mean in means_m), jumps(take)])
        print(
            f"{take.name:10s}  own {{:.2f}}  sized {{:.2f}}  raw {{:.2f}}  jumps {{}}".format(*rows[-1]),
            flush=True,
        )
    table = np.array(rows)
    print("median, most, takes over 2 cm:")
    for column, name in enumerate(("own", "sized", "raw")):
        values = table[:, column]
        print(
            f"{name:6s} {np.median(values):.2f}  {values.max():.2f}  {np.sum(values > 2.0)} of {len(values)}"
        )
    print(f"jumps  {table[:, 3].sum():.0f}")


if __name__ == "__main__":
    main()
