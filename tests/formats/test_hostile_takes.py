"""Takes from untrusted sources: pickles run no code, archives have a limit, lists stay in the folder."""

from __future__ import annotations

import io
import os
import pickle
import struct
import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
import soundfile
from synthetic_motions import stepping

from choreograph.core.errors import FormatError
from choreograph.formats.aist import load_arrays
from choreograph.formats.npz import read_npz
from choreograph.formats.register import import_takes, save_motion
from choreograph.library.building.options import BuildOptions

MOTION = stepping(60, period_s=0.5)
BEYOND_BYTES = 2 << 30


def one_line(path: Path, read) -> str:
    with pytest.raises(FormatError) as caught:
        read(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


# Opcodes: ( MARK, c GLOBAL, R REDUCE, o OBJ, i INST, V UNICODE, I INT, t TUPLE, b BUILD, . STOP
_PLACES = """
    os:system posix:system nt:system subprocess:Popen subprocess:call builtins:eval builtins:exec
    builtins:__import__ builtins:open builtins:getattr builtins:setattr __builtin__:eval
    __builtin__:apply importlib:import_module runpy:run_path pty:spawn shutil:rmtree pathlib:Path
    pickle:loads _pickle:loads copyreg:__newobj__ functools:partial operator:attrgetter
    operator:methodcaller types:FunctionType types:CodeType marshal:loads ctypes:CDLL code:interact
    timeit:timeit webbrowser:open numpy:load numpy:fromfile numpy:memmap numpy:save numpy:genfromtxt
    numpy:frompyfunc numpy:zeros numpy:f2py numpy:ndarray.tofile numpy.testing:runstring
    numpy._core.multiarray:fromfile numpy.core.multiarray:empty numpy._core.records:fromfile
    _codecs:decode _codecs:lookup codecs:encode torch:load torch.hub:load yaml:unsafe_load asyncio:run
    site:main distutils.spawn:spawn bdb:Bdb pdb:run cProfile:run profile:run doctest:debug_script
    unittest.mock:_importer choreograph.cli:main
"""
MODULES = [place.split(":") for place in _PLACES.split()]
ARGUMENT = "touch MARK"


def _calls(module: str, name: str) -> list[bytes]:
    """Every way of a pickle to call something."""
    function = f"c{module}\n{name}\n".encode()
    text = f"V{ARGUMENT}\n".encode()
    named = [bytes([len(text)]) + text.encode() for text in (module, name)]
    short = b"\x8c" + named[0] + b"\x8c" + named[1] + b"\x93"
    return [
        function + b"(" + text + b"tR.",
        b"\x80\x04" + short + b"(" + text + b"tR.",
        b"(" + function + text + b"o.",
        b"(" + text + f"i{module}\n{name}\n".encode() + b".",
        b"\x80\x02" + function + b"(" + text + b"t\x81.",
        b"\x80\x04" + function + b")}Vx\n" + text + b"s\x92.",
    ]


def test_360_pickles_run_no_code(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.pkl"
    tried = 0
    for module, name in MODULES:
        for data in _calls(module, name):
            path.write_bytes(data)
            one_line(path, load_arrays)
            tried += 1
    assert tried == 6 * len(MODULES) >= 300
    assert list(tmp_path.iterdir()) == [path]


def _doubled_lists() -> bytes:
    """2⁴⁰ numbers in a few bytes, as lists of the same list twice."""
    nested: list = [0.0]
    for _ in range(40):
        nested = [nested, nested]
    return pickle.dumps({"smpl_poses": nested})


def _encoded_again_and_again() -> bytes:
    """A megabyte of text turned into bytes 5,000 times."""
    call = b"c_codecs\nencode\n(" + b"h\x00V" + b"latin1\ntR"
    text = b"\x80\x02X" + struct.pack("<I", 1 << 20) + b"x" * (1 << 20) + b"q\x000"
    return text + b"(" + call * 5000 + b"l."


def _addresses() -> bytes:
    """An array whose bytes are addresses of objects, in the text of which they are used."""
    array = pickle.dumps(np.full(2, 1.5), protocol=2)[2:-1].replace(b"f8", b"O8")
    return b"\x80\x02}X\x0a\x00\x00\x00smpl_poses" + array + b"s."


BOMBS = {
    "addresses": _addresses(),
    "doubled lists": _doubled_lists(),
    "text made bytes": _encoded_again_and_again(),
    "a far memo": b"\x80\x02K\x01r\xff\xff\xff\x7f.",
    "an array without numbers": b"cnumpy\nndarray\n((I4000000000\ntVf8\ntR.",
    "a shape without numbers": pickle.dumps({}, 0)[:-1] + b"(Va\ncnumpy\nndarray\n((I3000000000\ntVi1\ntRu.",
    "a long integer": b"\x80\x02\x8b" + struct.pack("<i", 1 << 22) + b"\xff" * (1 << 22) + b".",
    "digits": b"L" + b"9" * (1 << 22) + b"L\n.",
    "marks": b"(" * (1 << 22) + b".",
    "a bytearray that is not there": b"\x80\x05\x96" + struct.pack("<Q", 1 << 40) + b".",
    "text that is not there": b"\x80\x04\x8d" + struct.pack("<Q", 1 << 62) + b".",
}  # fmt: skip


def _zeros(n_frames: int) -> bytes:
    packed = io.BytesIO()
    frames = {"root_pos_m": np.zeros((n_frames, 3)), "local_quat": np.zeros((n_frames, 1, 4))}
    joint = {"names": np.array(["a"]), "parents": [-1], "offsets_m": np.zeros((1, 3))}
    tips = {"tip_parents": np.zeros(0, int), "tips_m": np.zeros((0, 3))}
    np.savez_compressed(packed, fps=30.0, **frames, **joint, **tips)
    return packed.getvalue()


def _made_up_header() -> bytes:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }\n"
    packed = io.BytesIO(_zeros(2))
    with zipfile.ZipFile(packed, "a") as archive:
        archive.writestr("extra.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
    return packed.getvalue().replace(b"extra.npy", b"names.npy")


@pytest.mark.slow
def test_bombs_are_refused_with_little_memory_and_time(tmp_path):
    """In one process that has no more than 2 GiB beyond what the program itself takes."""
    for name, data in BOMBS.items():
        (tmp_path / f"{name}.pkl").write_bytes(data)
    (tmp_path / "zeros.npz").write_bytes(_zeros(20_000_000))
    (tmp_path / "header.npz").write_bytes(_made_up_header())
    assert (tmp_path / "zeros.npz").stat().st_size < 3e6
    code = f"""if True:
        import resource, time
        from pathlib import Path
        from choreograph.core.errors import FormatError
        from choreograph.formats.aist import load_arrays
        from choreograph.formats.npz import read_npz
        base = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (base + {BEYOND_BYTES},) * 2)
        for path in sorted(Path({str(tmp_path)!r}).iterdir()):
            began = time.process_time()
            try:
                print(path.name, "read:", (read_npz if path.suffix == ".npz" else load_arrays)(path))
            except FormatError as error:
                assert time.process_time() - began < 5, path
                assert "\\n" not in str(error)
                print("refused")
    """
    child = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert child.returncode == 0, child.stderr
    assert child.stdout.split() == ["refused"] * (len(BOMBS) + 2)


def _lying_about_its_size(n_bytes: int) -> bytes:
    """An entry that states 100 bytes and unpacks to `n_bytes`."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("root_pos_m.npy", bytes(n_bytes))
        for name in ("names", "local_quat", "fps", "parents", "offsets_m", "tip_parents", "tips_m"):
            archive.writestr(f"{name}.npy", b"")
    return packed.getvalue().replace(struct.pack("<I", n_bytes), struct.pack("<I", 100))


def test_an_entry_is_not_unpacked_beyond_the_size_that_it_states(tmp_path):
    (tmp_path / "a.npz").write_bytes(_lying_about_its_size(1 << 26))
    tracemalloc.start()
    one_line(tmp_path / "a.npz", read_npz)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes < 1 << 22


def test_arrays_of_dances_are_read_from_pickles(tmp_path):
    content = {"poses": np.arange(12.0).reshape(3, 4), "scaling": 93.0, "name": "x"}
    for protocol in range(6):
        (tmp_path / "a.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
        np.testing.assert_array_equal(load_arrays(tmp_path / "a.pkl")["poses"], content["poses"])


@pytest.mark.parametrize("fps", [1e-3, 0.0, -30.0, 1e12, np.nan])
def test_rates_that_no_recording_has_are_refused(tmp_path, fps):
    save_motion(tmp_path / "a.npz", MOTION)
    arrays = dict(np.load(tmp_path / "a.npz"))
    np.savez(tmp_path / "b.npz", **{**arrays, "fps": fps})
    one_line(tmp_path / "b.npz", read_npz)


@pytest.fixture
def folder(tmp_path):
    """A take in a folder, and a song outside of it."""
    (tmp_path / "takes").mkdir()
    save_motion(tmp_path / "takes" / "a.bvh", MOTION)
    soundfile.write(tmp_path / "song.wav", np.zeros(8000, np.float32), 8000)
    soundfile.write(tmp_path / "takes" / "own.wav", np.zeros(8000, np.float32), 8000)
    return tmp_path / "takes"


@pytest.mark.parametrize("song", ["../song.wav", "{absolute}", "../takes/../song.wav"])
def test_songs_outside_of_the_folder_are_read_on_request_only(folder, song):
    given = song.format(absolute=folder.parent / "song.wav")
    (folder / "manifest.csv").write_text(f"name,song\na,{given}\n")
    message = one_line(folder, lambda path: list(import_takes(path)))
    assert "--allow-outside" in message and "song.wav" in message
    (take,) = import_takes(folder, allow_outside=True)
    assert os.path.samefile(take.song_path, folder.parent / "song.wav")
    assert not BuildOptions().allow_outside


@pytest.mark.parametrize("song", ["own.wav", "../takes/own.wav", "./own.wav"])
def test_songs_in_the_folder_are_read(folder, song):
    (folder / "manifest.csv").write_text(f"name,song\na,{song}\n")
    (take,) = import_takes(folder)
    assert os.path.samefile(take.song_path, folder / "own.wav")


def test_counts_outside_of_the_folder_are_refused(folder):
    (folder.parent / "a.csv").write_text("time_s,number\n0.1,1\n0.6,2\n")
    (folder / "manifest.csv").write_text("name,counts\na,../a.csv\n")
    assert "not in the folder" in one_line(folder, lambda path: list(import_takes(path, allow_outside=True)))


@pytest.mark.parametrize(
    "row",
    ["a,-1e9,", "a,1e9,", "a,nan,", f"a,0,{'x' * 200_000}", 'a,0,"' + "x" * 200_000, f"a,{'9' * 140_000},"],
)
def test_cells_that_no_list_has_are_refused(folder, row):
    (folder / "manifest.csv").write_text(f"name,audio_offset_s,genre\n{row}\n")
    assert len(one_line(folder, lambda path: list(import_takes(path)))) < 500
