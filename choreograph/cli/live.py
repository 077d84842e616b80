"""`choreograph live`, which sends a dance to an avatar program while its song plays."""

from __future__ import annotations

import socket
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

import click

from choreograph.cli.declared import Command, Input, argument, option
from choreograph.cli.present import examples, say, stages
from choreograph.core.errors import ChoreographError, ParameterError
from choreograph.core.progress import counted
from choreograph.settings import engine_names

if TYPE_CHECKING:
    from choreograph.live.stream import Sent
    from choreograph.motion.motion import Motion
    from choreograph.pipeline.dancing import Dance

# The modes of the command: a new dance, a dance that was made before, and music that is still playing.
_NEW, _MADE, _STREAM = "", "made", "stream"
_danced = partial(option, modes=(_NEW, _STREAM))
_PORTS, _RATES = click.IntRange(1, 65535), click.FloatRange(10, 240)


@click.command(
    cls=Command,
    reasons={_MADE: "was danced before", _STREAM: "is danced as it arrives"},
    short_help="Send a dance to an avatar program while its song plays.",
    epilog=examples(
        "choreograph live song.mp3                          a dance for VSeeFace, Warudo, Unity or Unreal",
        "choreograph live song.mp3 --dance dance.bvh        a dance that was made before",
        "choreograph live song.mp3 --host 192.168.0.7 --silent",
        "choreograph live song.mp3 --websocket 8765         frames as JSON for web pages and programs, too",
        "arecord -f cd | choreograph live --input -         a dance to music that is still playing",
        "choreograph live --input mic                       the same from a microphone",
    ),
)
@argument("song", type=Input("song"), required=False, modes=(_NEW, _MADE))
@option(
    "--input",
    "stream",
    type=click.Choice(["-", "mic"]),
    selects=_STREAM,
    help="Follow standard input or a microphone.",
)
@option(
    "--pcm",
    metavar="FORMAT",
    modes=(_STREAM,),
    help="Format of standard input, such as 44100:2:s16. Default: its WAV header.",
)
@option(
    "--latency",
    type=click.FloatRange(-1.0, 1.0),
    modes=(_STREAM,),
    default=0.0,
    show_default=True,
    metavar="SECONDS",
    help="With --input, send frames so much earlier than the sound arrives here.",
)
@option(
    "--dance",
    type=Input("motion"),
    selects=_MADE,
    metavar="MOTION",
    help="A motion to the song. Default: a new dance.",
)
@_danced(
    "--db", type=Input("repertoire"), multiple=True, metavar="FILE|DIR", help="Repertoire of a new dance."
)
@option("--engine", modes=(_NEW,), metavar="|".join(engine_names()), help="Engine of a new dance (graph).")
@_danced("--genre", help="Genre of a new dance.")
@_danced("--seed", default=0, show_default=True, help="Seed of a new dance.")
@option("--host", default="127.0.0.1", show_default=True, help="Machine of the receiver.")
@option("--port", type=_PORTS, default=39539, show_default=True, help="UDP port of the receiver.")
@option("--websocket", type=_PORTS, metavar="PORT", help="Also send frames as JSON to this port's clients.")
@_danced("--control", type=_PORTS, metavar="PORT", help="Take requests by OSC on this UDP port.")
@option("--fps", type=_RATES, default=60.0, show_default=True, help="Frames a second.")
@option("--silent", modes=(_NEW, _MADE), is_flag=True, help="Do not play the song here.")
def command(
    song: Path | None,
    stream: str | None,
    pcm: str | None,
    latency: float,
    dance: Path | None,
    db: tuple[Path, ...],
    engine: str | None,
    genre: str | None,
    seed: int,
    host: str,
    port: int,
    websocket: int | None,
    control: int | None,
    fps: float,
    silent: bool,
) -> None:
    """Dance to SONG and send the body by the VMC protocol, a bundle of OSC over UDP for each frame.

    Receivers listen on UDP port 39539 unless they are told otherwise. Ctrl-C ends it.

    A new dance can be changed while it runs. Type genre salsa, energy 0.7, pin take:NAME, pin motif:41 or
    seed 3, and it is danced from the next phrase on.

    With --input, beats are followed while the music plays, and the dance is planned 2 s ahead of it.
    """
    arguments = {"engine": engine or "graph", "genre": genre, "seed": seed}
    receiver = _receiver(host, port)
    if stream is not None:
        _follow(stream, pcm, latency, db, genre, seed, receiver, (websocket, control), fps)
        return
    if song is None:
        raise ParameterError("expected a SONG, or --input, got neither")
    _play(song, dance, db, arguments, receiver, (websocket, control), fps, silent=silent)


@dataclass(frozen=True)
class _Receiver:
    """Where packets are sent."""

    name: str
    family: int
    address: tuple[object, ...]


def _receiver(host: str, port: int) -> _Receiver:
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as error:  # a UnicodeError for a name that no machine can have
        reason = getattr(error, "strerror", None) or "not a name of a machine"
        raise ChoreographError(f"expected the receiver's machine, got {host!r}: {reason}") from None
    return _Receiver(f"{host}:{port}", found[0], found[4])


def _play(
    song: Path,
    dance: Path | None,
    db: tuple[Path, ...],
    arguments: dict[str, Any],
    receiver: _Receiver,
    ports: tuple[int | None, int | None],
    fps: float,
    *,
    silent: bool,
) -> None:
    """Send a dance to a song that is played here."""
    from choreograph.live.changing import ChangingBody, changing
    from choreograph.live.requests import listening, take_lines
    from choreograph.live.sound import playing
    from choreograph.live.sound import silent as not_heard
    from choreograph.live.stream import send_frames
    from choreograph.live.vmc import VmcBody
    from choreograph.live.websocket import serving

    websocket, control = ports
    made = _dance(song, db, arguments) if dance is None else None
    motion = made.motion if made is not None else _motion(song, dance)
    body = ChangingBody(VmcBody.of(motion.resampled(fps), made.figures if made is not None else ()))
    clock = _Clock()
    with ExitStack() as stack:
        out = stack.enter_context(socket.socket(receiver.family, socket.SOCK_DGRAM))
        ask = None
        if made is not None:
            changes = stack.enter_context(
                changing(song, db, made, body, fps, arguments, song_s=clock, note=say)
            )
            ask = changes.request
        if ask is not None and control is not None:
            stack.enter_context(listening(control, ask, say))
        frames = stack.enter_context(serving(websocket, ask)) if websocket is not None else None
        clock.song_s = stack.enter_context(not_heard() if silent else playing(song))
        if ask is not None:
            Thread(target=take_lines, args=(sys.stdin, ask, say), daemon=True).start()

        def send(frame: int, time_s: float) -> None:
            _send(out, body.packet(frame, time_s), receiver.address)
            if frames is not None:
                frames.put(body.pose(frame, time_s))

        say(f"sending {len(body) / fps:.1f} s to {receiver.name}, {fps:g} frames a second: Ctrl-C ends it")
        sent = send_frames(len(body), fps, send, song_s=clock)
    _say_sent(sent)


def _follow(
    source: str,
    pcm: str | None,
    latency_s: float,
    db: tuple[Path, ...],
    genre: str | None,
    seed: int,
    receiver: _Receiver,
    ports: tuple[int | None, int | None],
    fps: float,
) -> None:
    """Send a dance to music that is still playing, until it ends."""
    from choreograph.live.requests import listening
    from choreograph.live.sound import PcmFormat, microphone, pcm_blocks
    from choreograph.live.stream import send_frames
    from choreograph.live.stream_dance import StreamTime, hear_all, stream_dance
    from choreograph.live.websocket import serving

    websocket, control = ports
    given = None if pcm is None else PcmFormat.parse(pcm)
    if source == "mic" and given is not None:
        raise ParameterError("expected --pcm with --input -, got it with a microphone: leave it out")
    with ExitStack() as stack:
        out = stack.enter_context(socket.socket(receiver.family, socket.SOCK_DGRAM))
        dance = stack.enter_context(stream_dance(db, say, genre=genre, seed=seed))
        ask = dance.requests.put
        if control is not None:
            stack.enter_context(listening(control, ask, say))
        frames = stack.enter_context(serving(websocket, ask)) if websocket is not None else None
        blocks = stack.enter_context(microphone()) if source == "mic" else pcm_blocks(sys.stdin.buffer, given)
        stream_s = StreamTime()
        began_s = time.perf_counter()

        def send(frame: int, time_s: float) -> None:
            now_s = stream_s() + latency_s
            body = dance.body.at(now_s)
            _send(out, body.packet(0, now_s), receiver.address)
            if frames is not None:
                frames.put({**body.pose(0, now_s), "frame": frame})

        say(f"sending to {receiver.name}, {fps:g} frames a second: the end of the music or Ctrl-C ends it")
        reader = Thread(target=hear_all, args=(dance, blocks, stream_s), daemon=True)
        reader.start()
        sent = send_frames(
            None, fps, send, song_s=lambda: time.perf_counter() - began_s, ended=lambda: not reader.is_alive()
        )
    late = f", {counted(dance.n_late, 'part')} too late" if dance.n_late else ""
    say(f"danced {counted(dance.n_parts, 'part')} in {dance.heard_s:.1f} s{late}")
    _say_sent(sent)


def _say_sent(sent: Sent) -> None:
    skipped = f", {sent.n_skipped} skipped" if sent.n_skipped else ""
    say(f"sent {sent.n_frames} frames{skipped}, at most {1000 * sent.latest_s:.1f} ms late")


class _Clock:
    """The time in the song, which begins when all is ready."""

    def __init__(self) -> None:
        self.song_s: Callable[[], float] = lambda: 0.0

    def __call__(self) -> float:
        return self.song_s()


def _dance(song: Path, db: tuple[Path, ...], arguments: dict[str, Any]) -> Dance:
    from choreograph.library.repertoire import as_repertoire
    from choreograph.pipeline.dancing import dance

    with stages(quiet=False) as shown:
        return dance(song, as_repertoire(db), report=shown.report, **arguments)


def _motion(song: Path, dance: Path | None) -> Motion:
    from choreograph.formats.register import load_motion
    from choreograph.music.song import load_song

    load_song(song)  # an error before anything is sent
    assert dance is not None
    return load_motion(dance)


def _send(out: socket.socket, packet: bytes, address: tuple[object, ...]) -> None:
    """Send a packet. A receiver that does not listen yet is not an error."""
    with suppress(ConnectionRefusedError):
        out.sendto(packet, address)
