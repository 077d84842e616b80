"""Every public call, one argument at a time replaced by a hostile value: it works, or says in a line why not.

A public name that `sound_calls` does not know how to call fails: add it there.
"""

from __future__ import annotations

import inspect
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from synthetic_characters import CHARACTERS, write_character
from synthetic_layers import random_source
from synthetic_motions import stepping
from synthetic_repertoire import (
    synthetic_contents,
    synthetic_takes,
    with_counts,
    with_vocabulary,
    write_clicks,
)

import choreograph as cg
from choreograph.characters.character import perform
from choreograph.choreography.graph.cost import CostContext
from choreograph.core.counts import make_counts, numbers_in_bar
from choreograph.library.schema import NetArrays
from choreograph.library.writing import write_repertoire
from choreograph.pipeline import dancing

MODULES = {"metrics"}  # whose functions have checks, and tests of them, of their own
# What an error from inside is; one that is none of these fails the test by itself.
FROM_INSIDE = (
    ArithmeticError, AssertionError, AttributeError, LookupError, MemoryError, OSError, RuntimeError,
    TypeError, UnboundLocalError, ValueError, Warning,
)  # fmt: skip


class Anything:
    """A class given for an instance; it may be called with whatever."""

    def __init__(self, *_: object) -> None:
        pass


def hostile_values() -> dict[str, Any]:
    """By how they are written, made anew."""
    return {
        "None": None, "'text'": "text", "''": "", "'a\\nb'": "a\nb", "b'x'": b"x",
        "Path('gone')": Path("gone"),
        "True": True, "3": 3, "-1": -1, "10**12": 10**12, "10**400": 10**400, "1.5": 1.5,
        "nan": float("nan"), "inf": float("inf"), "1j": 1j, "np.int64(2)": np.int64(2),
        "np.float32(0.5)": np.float32(0.5), "[]": [], "{}": {}, "{'a': 'b'}": {"a": "b"},
        "['a', 'b']": ["a", "b"], "[['a']]": [["a"]], "[[1.0], [2.0, 3.0]]": [[1.0], [2.0, 3.0]],
        "[10**12]": [10**12], "object()": object(), "a class": Anything, "lambda": lambda *_: None,
        "np.zeros(0)": np.zeros(0), "np.zeros((2, 2))": np.zeros((2, 2)),
        "np.full(3, nan)": np.full(3, np.nan), "np.array(['a', 'b'])": np.array(["a", "b"]),
        "np.array([object(), None])": np.array([object(), None]),
    }  # fmt: skip


@dataclass(frozen=True)
class Sound:
    """A call that works, and which of its arguments are replaced: all that it takes, or `only` some."""

    call: Callable[..., Any]
    arguments: dict[str, Any]
    only: tuple[str, ...] = ()
    too_long: tuple[tuple[str, str], ...] = ()  # (parameter, value) that works, and takes seconds

    @property
    def parameters(self) -> tuple[str, ...]:
        """The names of the arguments to replace."""
        taken = inspect.signature(self.call).parameters.values()
        named = [p.name for p in taken if p.kind not in (p.VAR_KEYWORD, p.VAR_POSITIONAL)]
        return self.only or tuple(dict.fromkeys((*named, *self.arguments)))


def sound(call: Callable[..., Any], /, **arguments: Any) -> Sound:
    return Sound(call, arguments)


@pytest.fixture(scope="module")
def things(tmp_path_factory):
    """A repertoire with motifs and an untrained rollout network, a song, a dance to it, and parts of them."""
    from choreograph.nets.configs import rollout_config
    from choreograph.nets.rollout import RolloutNet

    folder = tmp_path_factory.mktemp("sweep")
    takes = with_counts(synthetic_takes(duration_s=15.0))
    contents = with_vocabulary(synthetic_contents(takes), takes)
    weights, config = RolloutNet(rollout_config("tiny")).to_arrays()
    with_rollout = {**contents.nets, "rollout": NetArrays(config, weights)}
    write_repertoire(folder / "rep.h5", replace(contents, nets=with_rollout))
    repertoire = cg.Repertoire.open(folder / "rep.h5")
    song = cg.load_song(write_clicks(folder / "clicks.wav", duration_s=5.0))
    write_character(folder / "hero.glb", CHARACTERS["mixamo"])
    character, motion = cg.read_character(folder / "hero.glb"), stepping(30)
    source, features = random_source(0, n_motifs=3)
    made = cg.dance(song, repertoire, candidates=4)
    for suffix in ("npz", "json"):
        made.save(folder / f"made.{suffix}")
    scene = cg.scene(song, repertoire, dancers=2, candidates=4)
    scene.save(folder / "scene.json")
    (folder / "empty").mkdir()
    counts = make_counts(np.arange(9) / 2, numbers_in_bar(9, 4), 4)
    return SimpleNamespace(
        folder=folder, repertoire=repertoire, song=song, made=made, scene=scene,
        character=character, motion=motion,
        layer=source.layer(2), next_layer=source.layer(3), features=features, counts=counts,
        analysed=dancing.analyse_song(song, repertoire), take=takes[0].take,
        performance=perform(motion, character.rig, character.bones),
        stream=cg.RolloutStream(counts, repertoire),
    )  # fmt: skip


def values_of(instance: Any) -> dict[str, Any]:
    """The fields of a dataclass, to make it again."""
    return {field.name: getattr(instance, field.name) for field in fields(instance)}


def sound_calls(t: SimpleNamespace) -> dict[str, Sound]:
    """By public name, of which some are called in several ways, told apart after a colon."""
    return {**sound_classes(t), **sound_layers(t), **sound_functions(t)}


def sound_classes(t: SimpleNamespace) -> dict[str, Sound]:
    """The calls of classes and of their methods, but for `sound_layers`."""
    motion, skeleton, stream = t.motion, t.motion.skeleton, t.stream
    return {
        "Alternative": sound(
            cg.Alternative, dance=t.made, start_s=1.0, end_s=2.0, costs={"joins": 0.5}, why="another take"
        ),
        "Ban": sound(cg.Ban, genre="a"),
        "BuildOptions": sound(cg.BuildOptions),
        "BuildResult": sound(cg.BuildResult, repertoire=t.repertoire, notes=()),
        "BvhOptions": sound(cg.BvhOptions),
        "Counts": sound(cg.Counts, **values_of(t.counts)),
        "Counts.within": sound(t.counts.within, start_s=0.0, end_s=1.0),
        "Credits": sound(cg.Credits),
        "Dance": sound(cg.Dance, motion=motion, plan=t.made.plan),
        "Dance.save": sound(t.made.save, path="a.npz"),
        "Dance.save:bvh": Sound(t.made.save, {"path": "a.bvh"}, ("bvh",)),
        "Dance.save:page": Sound(t.made.save, {"path": "a.html"}, ("report",), (("report", "None"),)),
        "DanceConfig": sound(cg.DanceConfig),
        "GltfCharacter": sound(cg.GltfCharacter, **values_of(t.character)),
        "GltfCharacter.dancing": sound(t.character.dancing, motion=motion),
        "GltfCharacter.dancing_clips": sound(t.character.dancing_clips, motions={"a": motion}),
        "GltfCharacter.with_animation": sound(
            t.character.with_animation, performance=t.performance, name="dance"
        ),
        "Keep": sound(cg.Keep, start_s=0.0, end_s=1.0),
        "Motion": sound(cg.Motion, **values_of(motion)),
        "Motion.moved": sound(motion.moved, yaw_rad=1.0, shift_m=np.zeros(3)),
        "Motion.resampled": sound(motion.resampled, fps=20.0),
        "Motion.sampled": sound(motion.sampled, frames=np.arange(3.0)),
        "Motion.sampled_smooth": sound(motion.sampled_smooth, frames=np.arange(3.0)),
        "Motion.sliced": sound(motion.sliced, start=0, stop=2),
        "MotifPin": sound(cg.MotifPin, at_s=1.0, motif=1),
        "Plan": sound(cg.Plan, **values_of(t.made.plan)),
        "Plan.from_json": sound(cg.Plan.from_json, text=t.made.plan.to_json()),
        "Plan.read": sound(cg.Plan.read, path=t.folder / "made.json"),
        "Repeat": sound(cg.Repeat, start_s=0.0, end_s=1.0, at_s=2.0, mirrored=True),
        "Repertoire": sound(cg.Repertoire, file=t.repertoire._file),
        "Repertoire.body_pos_m": sound(t.repertoire.body_pos_m, take=0),
        "Repertoire.clip_motion_beats": sound(t.repertoire.clip_motion_beats, clip=0),
        "Repertoire.clip_start_s": sound(t.repertoire.clip_start_s, clip=0),
        "Repertoire.counts": sound(t.repertoire.counts, take=0),
        "Repertoire.figures": sound(t.repertoire.figures, take=0),
        "Repertoire.motion": sound(t.repertoire.motion, take=0, start_s=1.0, stop_s=2.0),
        "Repertoire.motion_beats_s": sound(t.repertoire.motion_beats_s, take=0),
        "Repertoire.net": sound(t.repertoire.net, name="words"),
        "Repertoire.open": sound(cg.Repertoire.open, path=t.repertoire.path),
        "Repertoire.rollout_net": sound(t.repertoire.rollout_net, genre=""),
        "Repertoire.take_index": sound(t.repertoire.take_index, name="take0"),
        "Repertoire.verify": sound(t.repertoire.verify, report=None),
        "RolloutFrame": sound(
            cg.RolloutFrame, time_s=0.0, root_pos_m=np.zeros(3), local_quat=np.zeros((24, 4))
        ),
        "RolloutStream": sound(cg.RolloutStream, song=t.counts, repertoire=t.repertoire),
        "RolloutStream:song": Sound(
            cg.RolloutStream, {"song": t.song, "repertoire": t.repertoire}, ("beats",)
        ),
        "RolloutStream.feed": sound(stream.feed, samples=np.zeros(100)),
        "RolloutStream.genre": sound(lambda genre: setattr(stream, "genre", genre), genre="a"),
        "RolloutStream.request": sound(stream.request, motif=0),
        "Session": Sound(
            cg.Session, {"song": t.song, "repertoire": t.repertoire, "start_s": 0.0, "duration_s": 1.0},
            too_long=(("repertoire", "None"),),
        ),
        "Session.dance": sound(cg.Session(t.song, t.repertoire).dance, engine="mixer", seed=1, genre=None),
        "Dancer": sound(cg.Dancer, name="a", dance=t.made, character=None),
        "Scene": sound(cg.Scene, dancers=t.scene.dancers, plan=t.scene.plan),
        "Scene.save": sound(t.scene.save, path="a.bvh"),
        "ScenePlan": sound(cg.ScenePlan, dances=t.scene.plan.dances, dancers=t.scene.plan.dancers),
        "ScenePlan.from_json": sound(cg.ScenePlan.from_json, text=t.scene.plan.to_json()),
        "ScenePlan.read": sound(cg.ScenePlan.read, path=t.folder / "scene.json"),
        "Session.alternatives": sound(
            cg.Session(t.song, t.repertoire).alternatives, span=(1.0, 3.0), n=1, existing=t.made
        ),
        "Skeleton": sound(cg.Skeleton, **values_of(skeleton)),
        "Skeleton.index": sound(skeleton.index, name="head"),
        "Skeleton.order_of": sound(skeleton.order_of, other=skeleton),
        "Skeleton.same_as": sound(skeleton.same_as, other=skeleton),
        "Song": sound(cg.Song, samples=np.zeros(100), name="quiet"),
        "Song.part": sound(t.song.part, start_s=0.5),
        "Swap": sound(cg.Swap, start_s=0.0, end_s=1.0),
        "Hold": sound(cg.Hold, start_s=0.0, end_s=1.0),
        "MoveJoin": sound(cg.MoveJoin, at_s=1.0, counts=-1),
        "Take": sound(cg.Take, **values_of(t.take)),
        "TakePin": sound(cg.TakePin, start_s=0.0, end_s=1.0, take="take0"),
        "Vary": sound(cg.Vary, start_s=0.0, end_s=1.0),
    }  # fmt: skip


def sound_layers(t: SimpleNamespace) -> dict[str, Sound]:
    """The calls of what a custom cost is given."""
    layer = t.layer
    return {
        "Cost": sound(cg.Cost),
        "Cost.for_dance": sound(
            cg.Cost.for_dance, context=CostContext(0, None, layer.bank, None, (), t.features)
        ),
        "Cost.edge": sound(cg.Cost().edge, previous=layer, next=t.next_layer, song_features=t.features),
        "Cost.min_edge_costs": sound(
            cg.Cost().min_edge_costs, previous=layer, next=t.next_layer, song_features=t.features
        ),
        "Cost.node": sound(cg.Cost().node, layer=layer, song_features=t.features),
        "Layer": sound(cg.Layer, **values_of(layer)),
        "Layer.subset": sound(layer.subset, nodes=np.array([0])),
        "Layer.poses_m": sound(layer.poses_m, shares=(0.0, 1.0)),
        "Layer.headings_rad": sound(layer.headings_rad, shares=(0.5,)),
        "Layer.travel_m": sound(layer.travel_m, shares=(0.5, 1.0)),
        "Layer.successors_in": sound(layer.successors_in, following=t.next_layer),
        "Layer.with_motif_counts": sound(layer.with_motif_counts, counts_before=layer.path.motif_counts),
        "Layer.with_danced": sound(layer.with_danced, danced_before=layer.path.danced),
        "Layer.with_take_usage": sound(layer.with_take_usage, usage_before_s=layer.path.take_usage_s),
        "Layer.with_turn": sound(layer.with_turn, before=layer, parent=np.arange(layer.n_nodes)),
        "SongFeatures": sound(cg.SongFeatures, **values_of(t.features)),
        "SongFeatures.section_at": sound(t.features.section_at, second=1),
        "SongFeatures.phrase_at": sound(t.features.phrase_at, second=1),
    }  # fmt: skip


def sound_functions(t: SimpleNamespace) -> dict[str, Sound]:
    """The calls of functions."""
    dance = partial(cg.dance, song=t.song, repertoire=t.repertoire)
    follow = ("genre", "signature", "motifs", "pins", "bans", "motif_draw")
    return {
        "build": sound(
            cg.build, sources=t.folder / "empty", output="rep.h5", preset="tiny", pretrained="nothing"
        ),
        "change_takes": sound(
            cg.change_takes, remove=["take1"], output="changed.h5",
            repertoire=shutil.copy(t.repertoire.path, t.folder / "changing.h5"),  # which it replaces
        ),
        "dance": Sound(dance, {"candidates": 4}, too_long=(("repertoire", "None"),)),
        "dance:keep": Sound(
            dance, {"candidates": 4, "existing": t.made, "keep": [cg.Keep(0.0, 2.5)]}, ("existing", "keep")
        ),
        "dance:mixer": Sound(dance, {"engine": "mixer"}, ("planner", "blending", *follow)),
        "dance:rollout": Sound(
            dance, {"engine": "rollout"}, ("style_song", "style_strength", "style_window", *follow)
        ),
        "edit": sound(
            cg.edit, existing=t.made, edits=[cg.Swap(1.0, 2.0)], repertoire=t.repertoire, song=t.song, seed=1
        ),
        "evaluate": sound(cg.evaluate, motion=t.motion, song=t.song),
        "lint": sound(cg.lint, repertoire=t.repertoire),
        "movement": sound(cg.movement, repertoire=t.repertoire),
        "coverage": sound(cg.coverage, repertoire=t.repertoire, songs=[t.song]),
        "count_file": sound(cg.count_file, path=t.folder / "clicks.wav"),
        "load_motion": sound(cg.load_motion, path=t.folder / "made.npz"),
        "save_motion": sound(cg.save_motion, path="a.npz", motion=t.motion),
        "load_song": sound(cg.load_song, path=t.folder / "clicks.wav"),
        "motifs_of": sound(cg.motifs_of, take="take0", repertoire=t.repertoire),
        "motifs_of:file": Sound(
            cg.motifs_of, {"take": t.folder / "made.npz", "repertoire": t.repertoire}, ("repertoire",)
        ),
        "read_character": sound(cg.read_character, path=t.folder / "hero.glb"),
        "render": sound(cg.render, plan=t.made.plan, repertoire=t.repertoire),
        "render:edited": Sound(
            lambda **edited: cg.render(replace(t.made.plan, **edited), t.repertoire),
            {},
            tuple(values_of(t.made.plan)),
        ),
        "scene": Sound(
            cg.scene,
            {
                "song": t.song, "repertoire": t.repertoire, "dancers": 2, "formation": "v",
                "relation": "unison",
                "genre": None, "characters": (), "start_s": 0.0, "duration_s": 2.0,
                "config": cg.DanceConfig(),
            },
            too_long=(("repertoire", "None"),),
        ),
        "render_scene_plan": sound(
            cg.render_scene_plan, plan=t.scene.plan, repertoire=t.repertoire, characters=(), song_path=None
        ),
        "signature_of": sound(cg.signature_of, name="a", repertoire=t.repertoire),
        "vary": Sound(
            cg.vary,
            {"song": t.song, "repertoire": t.repertoire, "n": 1, "seed": 1, "config": cg.DanceConfig()},
            too_long=(("repertoire", "None"),),
        ),
    }  # fmt: skip


def public_calls() -> Iterator[str]:
    """Functions, constructors, methods and settable properties of the public API that take an argument."""
    for name in cg.__all__:
        thing = getattr(cg, name)
        if inspect.ismodule(thing):
            assert name in MODULES
        elif inspect.isclass(thing) and not issubclass(thing, Exception):
            yield name
            ours = [base for base in thing.__mro__ if base.__module__.startswith("choreograph")]
            own = {key: value for base in ours for key, value in vars(base).items() if key[0] != "_"}
            yield from (f"{name}.{key}" for key, value in own.items() if _takes_one(thing, key, value))
        elif inspect.isfunction(thing) and inspect.signature(thing).parameters:
            yield name


def _takes_one(owner: type, name: str, attribute: Any) -> bool:
    """Whether an attribute of a class is called, or set, with an argument."""
    if isinstance(attribute, property):
        return attribute.fset is not None
    if not isinstance(attribute, classmethod | staticmethod) and not inspect.isfunction(attribute):
        return False
    n_own = 1 if inspect.isfunction(attribute) else 0
    return len(inspect.signature(getattr(owner, name)).parameters) > n_own


@pytest.fixture
def analysed_once(monkeypatch, things):
    """Dances to the one song do not analyse it again."""
    monkeypatch.setattr(dancing, "analyse_song", lambda *_, **__: things.analysed)


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n == "dance" else n for n in public_calls()]
)
def test_a_hostile_argument_is_refused_in_a_line(name, things, analysed_once, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    calls = {key: call for key, call in sound_calls(things).items() if key.split(":")[0] == name}
    assert calls, f"the sweep does not know how to call {name}: add it to sound_calls"
    wrong = [line for key, call in calls.items() for line in _wrong(key, call)]
    assert not wrong, "\n".join(wrong)


def _wrong(name: str, sound: Sound) -> Iterator[str]:
    """A line on each value that neither works nor is refused in a line."""
    for parameter in sound.parameters:
        for written, value in hostile_values().items():
            if (parameter, written) in sound.too_long:
                continue
            try:
                sound.call(**{**sound.arguments, parameter: value})
            except cg.ChoreographError as error:
                if len(str(error).splitlines()) != 1:
                    yield f"{name}({parameter}={written}): {str(error)!r}"
            except FROM_INSIDE as error:
                yield f"{name}({parameter}={written}): {type(error).__name__}: {error}"


def test_what_the_sweep_calls_is_sound(things, analysed_once, tmp_path, monkeypatch):
    """Else all that it finds would be that; and it calls no name that is not public any more."""
    monkeypatch.chdir(tmp_path)
    calls = sound_calls(things)
    assert {key.split(":")[0] for key in calls} == set(public_calls())
    for name, call in calls.items():
        if name == "build":  # of an empty folder: it goes on to importing, and no further
            with pytest.raises(cg.ParameterError, match="the folder is empty"):
                call.call(**call.arguments)
        else:
            call.call(**call.arguments)


def test_every_instance_is_represented_on_one_line(things, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    classes = {name for name in cg.__all__ if inspect.isclass(getattr(cg, name))}
    calls = {name: call for name, call in sound_calls(things).items() if name in classes}
    shown = {name: repr(call.call(**call.arguments)) for name, call in calls.items()}
    assert set(shown) == {name for name in classes if not issubclass(getattr(cg, name), Exception)}
    long = "x" * 200
    shown |= {
        "Plan of a long name": repr(replace(things.made.plan, song=long)),
        "Dance of a long name": repr(replace(things.made, plan=replace(things.made.plan, song=long))),
        "Credits of long texts": repr(cg.Credits(long, long, long, long)),
        "long settings": repr(cg.DanceConfig(weights={long: 1.0}, seed=10**90)),
        "made": repr(things.made),
    }
    wrong = {name: line for name, line in shown.items() if len(line) > 120 or len(line.splitlines()) != 1}
    assert wrong == {}
    assert shown["DanceConfig"] == "DanceConfig()"
    assert shown["Motion"] == "<Motion: 30 frames at 30 fps (1.0 s), 24 joints>"
    assert "1 take>" in shown["made"]
