"""Scenes: laws of distance, places, canon and mirror; one dancer is a dance; plans give the same again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from PIL import Image
from synthetic_characters import VRM, Spec, write_character
from synthetic_repertoire import synthetic_repertoire, write_clicks

import choreograph as cg
from choreograph.core.counts import counts_later_s
from choreograph.evaluation.metrics import scene as of_scene
from choreograph.evaluation.metrics.physical import foot_slide_cm_s
from choreograph.formats.gltf import SkinPoints
from choreograph.formats.gltf_document import read_gltf
from choreograph.motion import rotations as rot
from choreograph.motion.body import body_pos_m, mirrored_motion
from choreograph.motion.cameras import plan_cameras
from choreograph.motion.retargeting import leg_length_m
from choreograph.motion.skeleton import canonical_skeleton
from choreograph.pipeline.scene_planning import BodySize, sizes_of
from choreograph.pipeline.scenes import scene_paths

SCHEMA = json.loads(
    (Path(__file__).resolve().parents[2] / "data_schema" / "scene.schema.json").read_text(encoding="utf-8")
)
SETTINGS = {"candidates": 8, "cache": False}


@pytest.fixture(scope="module")
def song(tmp_path_factory) -> cg.Song:
    return cg.load_song(write_clicks(tmp_path_factory.mktemp("song") / "song.wav", duration_s=20.0))


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory) -> cg.Repertoire:
    return synthetic_repertoire(tmp_path_factory.mktemp("scene") / "rep.h5")


@pytest.fixture(scope="module")
def made(song, repertoire):
    """Makes a scene of the song, each once."""
    known = {}

    def make(n: int, formation="v", relation="unison") -> cg.Scene:
        key = n, str(formation), str(relation)
        if key not in known:
            known[key] = cg.scene(
                song, repertoire, dancers=n, formation=formation, relation=relation, **SETTINGS
            )
        return known[key]

    return make


CHANGES = ("line", "10-20=circle")


@pytest.mark.parametrize(
    ("n", "formation", "relation"),
    [
        (2, "pairs", "mirror"), (3, CHANGES, "unison"), (6, CHANGES, "canon:2"), (5, "v", "free"),
        (4, CHANGES, ("call-and-response", "10-20=mirror")), (8, CHANGES, "mirror"),
    ],
)  # fmt: skip
def test_bodies_stay_apart_and_are_seen(made, n, formation, relation):
    motions = made(n, formation, relation).motions
    pos_m = np.array([body_pos_m(motion) for motion in motions])
    assert of_scene.gaps_m(pos_m).min() >= 0.6
    assert of_scene.longest_hidden_s(pos_m, motions[0].fps) <= 4.0
    assert {motion.n_frames for motion in motions} == {motions[0].n_frames}


def test_places_are_reached_at_their_times(made):
    scene = made(6, CHANGES, "canon:2")
    for planned, motion in zip(scene.plan.dancers, scene.motions, strict=True):
        frames = np.minimum(np.round(np.array(planned.times_s) * motion.fps).astype(int), motion.n_frames - 1)
        places_m = np.stack([planned.x_m, planned.z_m], axis=1)
        assert np.abs(motion.root_pos_m[frames][:, [0, 2]] - places_m).max() < 1e-6


def test_formations_are_those_asked_for(made):
    scene = made(6, CHANGES)
    times_s = np.array(scene.plan.dancers[0].times_s)
    first, last = 0, int(np.searchsorted(times_s, 10.0 - 1e-6))
    assert times_s[last] == pytest.approx(10.0)
    at_m = np.array([[(d.x_m[k], d.z_m[k]) for d in scene.plan.dancers] for k in (first, last)])
    assert np.ptp(at_m[0, :, 1]) < 0.15  # one line
    around = at_m[1] - at_m[1].mean(axis=0)
    assert np.ptp(np.linalg.norm(around, axis=1)) < 0.8 and np.ptp(around[:, 1]) > 2.0  # a ring


def test_unison_in_one_formation_is_the_dance_itself(made, song, repertoire):
    scene = made(3)
    dance = cg.dance(song, repertoire, **SETTINGS).motion
    for motion in scene.motions[:1]:
        way = motion.root_pos_m - dance.root_pos_m
        assert np.ptp(way[:, 1]) == 0.0
    turns = [np.abs(np.sum(motion.local_quat * dance.local_quat, axis=-1)) for motion in scene.motions]
    assert np.percentile(turns[0], 1) > 0.99


def test_a_mirror_is_exact(made):
    right, left = made(2, "pairs", "mirror").motions
    other = mirrored_motion(right)
    assert np.abs(left.root_pos_m - other.root_pos_m).max() < 1e-6
    assert np.abs(np.abs(np.sum(left.local_quat * other.local_quat, axis=-1)) - 1.0).max() < 1e-6


def test_a_canon_is_an_exact_shift_in_counts(made):
    """Arms and trunk of the dance, which no way over the stage changes, 2 counts later."""
    scene = made(4, "line", "canon:2")
    first, later = scene.motions[0], scene.motions[2]
    beats_s = np.array(scene.plan.dances[0].music_beats_s)
    times_s = beats_s[(beats_s > 6.0) & (beats_s < 15.0)]
    upper = [first.skeleton.index(name) for name in ("spine1", "neck", "left_shoulder", "right_elbow")]
    frames = times_s * first.fps
    behind = later.sampled(frames).local_quat[:, upper]
    before = first.sampled(counts_later_s(beats_s, times_s, -2) * first.fps).local_quat[:, upper]
    assert np.abs(np.abs(np.sum(behind * before, axis=-1)) - 1.0).max() < 1e-4


def test_free_dancers_have_seeds_of_their_own(made):
    scene = made(5, "v", "free")
    assert [plan.seed for plan in scene.plan.dances] == [0, 1, 2, 3, 4]
    assert len({plan.to_json() for plan in scene.plan.dances}) == 5


def test_feet_slide_little_more_than_in_the_dance(made, song, repertoire):
    dance = cg.dance(song, repertoire, **SETTINGS).motion
    usual = foot_slide_cm_s(body_pos_m(dance), dance.fps)
    for motion in made(6, CHANGES, "unison").motions:
        assert foot_slide_cm_s(body_pos_m(motion), motion.fps) < usual + 12.0


def test_one_dancer_is_the_dance(song, repertoire, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    one = cg.scene(song, repertoire, dancers=1, **SETTINGS)
    dance = cg.dance(song, repertoire, **SETTINGS)
    for suffix in ("bvh", "npz", "html", "glb", "png"):
        one.save(f"scene.{suffix}")
        dance.save(f"dance.{suffix}")
        assert Path(f"scene.{suffix}").read_bytes() == Path(f"dance.{suffix}").read_bytes(), suffix


def test_a_plan_gives_the_same_bytes_and_follows_its_schema(made, repertoire, tmp_path):
    scene = made(4, CHANGES, ("call-and-response", "10-20=mirror"))
    scene.save(tmp_path / "a.json")
    plan = cg.ScenePlan.read(tmp_path / "a.json")
    jsonschema.validate(json.loads((tmp_path / "a.json").read_text()), SCHEMA)
    assert plan == scene.plan
    again = cg.render_scene_plan(plan, repertoire)
    for suffix in ("json", "bvh"):
        scene.save(tmp_path / f"a.{suffix}")
        again.save(tmp_path / f"b.{suffix}")
        for a, b in zip(
            scene_paths(tmp_path / f"a.{suffix}", 4), scene_paths(tmp_path / f"b.{suffix}", 4), strict=True
        ):
            assert a.read_bytes() == b.read_bytes()
    assert cg.load_motion(tmp_path / "a-2.bvh").n_frames == scene.motions[1].n_frames


def test_generated_dances_are_made_again_from_the_plan(song, tmp_path):
    """A network dances: with the plan and the song, the same dances are made, to the byte."""
    repertoire, path = cg.starter_repertoire(), cg.example_songs()["house"]
    scene = cg.scene(
        path,
        repertoire,
        dancers=3,
        relation="free",
        engine="rollout",
        start_s=4.0,
        duration_s=5.0,
        cache=False,
    )
    assert [request.settings.get("seed", 0) for request in scene.plan.requests] == [0, 1, 2]
    scene.save(tmp_path / "a.json")
    jsonschema.validate(json.loads((tmp_path / "a.json").read_text()), SCHEMA)
    plan = cg.ScenePlan.read(tmp_path / "a.json")
    again = cg.render_scene_plan(plan, repertoire, song_path=path)
    for one, other in zip(scene.motions, again.motions, strict=True):
        assert np.array_equal(one.root_pos_m, other.root_pos_m)
        assert np.array_equal(one.local_quat, other.local_quat)
    with pytest.raises(cg.ParameterError, match="expected the song 'house' beside the plan"):
        cg.render_scene_plan(plan, repertoire)
    with pytest.raises(cg.ParameterError, match="to which another dance is made"):
        cg.render_scene_plan(plan, repertoire, song_path=song.path)
    with pytest.raises(cg.ParameterError, match="dance to its song again"):  # a plan of before
        cg.render_scene_plan(replace(plan, requests=()), repertoire, song_path=path)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"dancers": 0}, "expected 1 to 32 dancers"),
        ({"dancers": ["a", "a"]}, "of different names"),
        ({"formation": "star"}, "expected a formation among"),
        ({"relation": "canon:0"}, "expected a relation among"),
        ({"genre": ["a", "b"]}, "expected one genre unless dancers are free"),
        ({"formation": ["30-40=v"]}, "expected a part of the song"),
        ({"characters": ["gone.glb"]}, "gone.glb"),
    ],
)
def test_other_arguments_are_refused_in_one_line(song, repertoire, arguments, says):
    with pytest.raises(cg.ChoreographError, match=says) as error:
        cg.scene(song, repertoire, **arguments, **SETTINGS)
    assert "\n" not in str(error.value)


def test_a_glb_holds_all_skeletons(made, tmp_path):
    scene = made(4, CHANGES, ("call-and-response", "10-20=mirror"))
    scene.save(tmp_path / "a.glb")
    document = read_gltf(tmp_path / "a.glb")
    (animation,) = document.json["animations"]
    assert len(document.json["skins"]) == 4
    for dancer, (skin, motion) in enumerate(zip(document.json["skins"], scene.motions, strict=True)):
        root = skin["joints"][0]
        group = next(node for node in document.json["nodes"] if node.get("children") == [root])
        assert group["name"] == scene.dancers[dancer].name
        channels = {(c["target"]["node"], c["target"]["path"]): c["sampler"] for c in animation["channels"]}
        samplers = [animation["samplers"][channels[root, path]] for path in ("translation", "rotation")]
        places_m, turns = (document.array(sampler["output"]) for sampler in samplers)
        assert np.abs(places_m - motion.root_pos_m).max() < 1e-5
        same = np.abs(np.sum(np.roll(turns, 1, axis=1) * motion.local_quat[:, 0], axis=1))
        assert np.abs(same - 1.0).max() < 1e-5


def test_usd_holds_all_skeletons(made, tmp_path):
    usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdSkel, UsdValidation

    scene = made(3)
    scene.save(tmp_path / "a.usdc")
    stage = usd.Stage.Open(str(tmp_path / "a.usdc"))
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert UsdValidation.ValidationContext(validators).Validate(stage) == []
    cache = UsdSkel.Cache()
    roots = [prim for prim in stage.Traverse() if prim.IsA(UsdSkel.Root)]
    assert [prim.GetName() for prim in roots] == ["dancer_1", "dancer_2", "dancer_3"]
    for root, motion in zip(roots, scene.motions, strict=True):
        cache.Populate(UsdSkel.Root(root), usd.PrimDefaultPredicate)
        query = cache.GetSkelQuery(UsdSkel.Skeleton(root.GetChild("Skeleton")))
        for frame in (0, 333):
            at = query.ComputeJointSkelTransforms(float(frame))[0].ExtractTranslation()
            assert np.abs(np.array(at) - motion.root_pos_m[frame]).max() < 1e-4


def test_pictures_show_all_dancers(made, tmp_path):
    scene = made(3)
    scene.save(tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as picture:
        pixels = np.asarray(picture.crop((0, 0, 640, 220)).convert("RGB")).astype(int)
    background = np.median(pixels, axis=1, keepdims=True)
    columns = (np.abs(pixels - background).max(axis=2) > 70).any(axis=0)
    bodies = np.flatnonzero(np.diff(np.concatenate([[0], columns.astype(int), [0]])) == 1)
    assert len(bodies) >= 3 and np.ptp(bodies) > 150


def test_bodies_that_cannot_be_kept_apart_are_noted(song, repertoire, monkeypatch):
    monkeypatch.setattr("choreograph.pipeline.scene_planning.least_gap_m", lambda *_: 0.41)
    scene = cg.scene(song, repertoire, dancers=2, duration_s=6, **SETTINGS)
    assert any(note.startswith("bodies come as near as 0.41 m, not 0.6 m") for note in scene.notes)
    monkeypatch.undo()
    scene = cg.scene(song, repertoire, dancers=2, duration_s=6, **SETTINGS)
    assert not any("bodies come" in note for note in scene.notes)


def pelvis_way_m(character, motion):
    """The way (T, 2) of the pelvis of a character that dances a motion, on the ground."""
    document = character.dancing(motion)
    (animation,) = document.json["animations"]
    node = character.nodes[character.bones["pelvis"]]
    (channel,) = [
        c for c in animation["channels"] if c["target"] == {"node": node, "path": "translation"}
    ]  # fmt: skip
    return document.array(animation["samplers"][channel["sampler"]]["output"])[:, [0, 2]]


def test_characters_of_other_sizes_are_at_their_places(song, repertoire, tmp_path):
    sizes = (0.6, 1.2)
    for size in sizes:
        write_character(tmp_path / f"{size}.glb", Spec(VRM, size=size, along="", vrm=True))
    files = [tmp_path / f"{size}.glb" for size in sizes]
    scene = cg.scene(song, repertoire, dancers=2, characters=files, duration_s=8, **SETTINGS)
    legs_m = leg_length_m(repertoire.skeleton)
    for dancer, planned, size in zip(scene.dancers, scene.plan.dancers, sizes, strict=True):
        character = dancer.character
        assert planned.height == pytest.approx(character.leg_m / legs_m, abs=1e-3)
        assert character.leg_m == pytest.approx(size * leg_length_m(canonical_skeleton()), rel=0.02)
        apart_m = pelvis_way_m(character, dancer.dance.motion) - dancer.dance.motion.root_pos_m[:, [0, 2]]
        assert np.linalg.norm(apart_m, axis=1).max() < 0.08 * size
    scene.save(tmp_path / "a.glb", camera="front")  # one for each
    assert {"a-1.glb", "a-2.glb"} <= {path.name for path in tmp_path.iterdir()}
    write_character(tmp_path / "giant.glb", Spec(VRM, size=3.0, along="", vrm=True))
    with pytest.raises(cg.ParameterError, match=r"giant.glb: expected a character of 0.5 to 2 times"):
        cg.scene(song, repertoire, dancers=2, characters=[tmp_path / "giant.glb"], duration_s=4, **SETTINGS)


def test_large_characters_are_kept_farther_apart(song, repertoire, tmp_path):
    """Their flesh is as much thicker. Without a skin, they are planned as thin as mannequins."""
    size = 1.9
    write_character(tmp_path / "large.glb", Spec(VRM, size=size, along="", vrm=True))
    (tmp_path / "places.json").write_text("[[-0.9, 0], [0.9, 0]]")
    large = cg.read_character(tmp_path / "large.glb")
    bare = replace(large, skin=SkinPoints(np.zeros((0, 3)), np.zeros(0, np.int64)))
    least_m = {}
    for name, character in (("large", large), ("bare", bare)):
        scene = cg.scene(
            song, repertoire, dancers=2, formation=str(tmp_path / "places.json"), characters=[character],
            duration_s=8, **SETTINGS,
        )  # fmt: skip
        pos_m = np.array([body_pos_m(motion) for motion in scene.motions])
        least_m[name] = size * of_scene.gaps_m(pos_m / size).min()  # of capsules that are as much thicker
    assert least_m["large"] >= 0.6 > least_m["bare"]


def test_only_large_or_wide_characters_have_a_girth(tmp_path):
    skeleton = canonical_skeleton()
    for size in (0.8, 1.0, 1.2, 1.6):
        write_character(tmp_path / "a.glb", Spec(VRM, size=size, along="", vrm=True))
        character = cg.read_character(tmp_path / "a.glb")
        (found,) = sizes_of(1, [character], skeleton)
        assert found == BodySize(
            pytest.approx(size, rel=0.02), 1.0 if size < 1.5 else pytest.approx(size, rel=0.05)
        )
        if size == 1.0:
            pos_m = character.skin.pos_m * [1.0, 1.0, 2.0]  # twice as deep from chest to back
            (wide,) = sizes_of(1, [replace(character, skin=SkinPoints(pos_m, character.skin.bone))], skeleton)
            assert wide.height == found.height and 1.3 < wide.girth < 2.2


def test_a_camera_films_all_dancers_in_a_glb(made, tmp_path):
    """Read back: cuts on phrases, and every joint of every dancer in the picture of wide shots."""
    scene = made(4, CHANGES, ("call-and-response", "10-20=mirror"))
    scene.save(tmp_path / "a.glb", camera="cuts")
    path = plan_cameras(scene.motions, "cuts", scene.plan.dances[0].phrase_borders_s)
    assert {shot.name for shot in path.shots} >= {"wide"} and path.cuts_s
    document = read_gltf(tmp_path / "a.glb")
    (node,) = [index for index, one in enumerate(document.json["nodes"]) if "camera" in one]
    (animation,) = document.json["animations"]
    found = {c["target"]["path"]: c["sampler"] for c in animation["channels"] if c["target"]["node"] == node}
    at, turned = (animation["samplers"][found[path]] for path in ("translation", "rotation"))
    times_s, eyes_m = (np.asarray(document.array(at[key]), np.float64) for key in ("input", "output"))
    quat = np.roll(np.asarray(document.array(turned["output"]), np.float64), 1, axis=1)
    np.testing.assert_allclose(times_s.ravel(), path.keys[0], atol=1e-4)
    lens = document.json["cameras"][0]["perspective"]
    high = np.tan(lens["yfov"] / 2)
    for shot in path.shots:
        if shot.name != "wide":
            continue
        key = int(np.abs(times_s.ravel() - shot.start_s).argmin())
        frames = slice(int(shot.start_s * 60), int(shot.end_s * 60))
        points_m = np.concatenate([one.joint_pos_m()[frames].reshape(-1, 3) for one in scene.motions])
        seen = rot.rotate(rot.invert(quat[key]), points_m - eyes_m[key])  # the camera looks along -Z
        assert (seen[:, 2] < 0).all()
        assert np.abs(seen[:, 1] / -seen[:, 2]).max() < high
        assert np.abs(seen[:, 0] / -seen[:, 2]).max() < high * lens["aspectRatio"]


def test_a_camera_is_in_page_video_and_usd_and_refused_elsewhere(made, tmp_path, monkeypatch):
    usd = pytest.importorskip("pxr.Usd")
    scene = made(3)
    scene.save(tmp_path / "a.html", camera="follow")
    assert '"shots":[{"name":"follow"' in (tmp_path / "a.html").read_text().replace(" ", "")
    scene.save(tmp_path / "a.usda", camera="front")
    assert usd.Stage.Open(str(tmp_path / "a.usda")).GetPrimAtPath("/Dance/Camera").IsValid()
    filmed = []
    monkeypatch.setattr("choreograph.view.video.write_video", lambda *_, **given: filmed.append(given))
    scene.save(tmp_path / "a.mp4", camera="cuts")
    assert len(filmed[0]["others"]) == 2 and filmed[0]["camera"].cuts_s == list(
        plan_cameras(scene.motions, "cuts", scene.plan.dances[0].phrase_borders_s).cuts_s
    )
    for name, camera in (("a.bvh", "front"), ("a.png", "cuts"), ("a.glb", "drone")):
        with pytest.raises(cg.ParameterError, match="expected"):
            scene.save(tmp_path / name, camera=camera)
