"""`choreograph live`, which sends a dance to an avatar program while its song plays."""

from __future__ import annotations

import socket
from contextlib import suppress
from pathlib import Path

import click

from choreograph.cli.present import Command, examples, say, stages
from choreograph.core.errors import ChoreographError, ParameterError

_FILE = click.Path(path_type=Path)
_PORTS, _RATES = click.IntRange(1, 65535), click.FloatRange(10, 240)


@click.command(
    cls=Command,
    short_help="Send a dance to an avatar program while its song plays.",
    epilog=examples(
        "choreograph live song.mp3                          a dance for VSeeFace, Warudo, Unity or Unreal",
        "choreograph live song.mp3 --dance dance.bvh        a dance that was made before",
        "choreograph live song.mp3 --host 192.168.0.7 --silent",
    ),
)
@click.argument("song", type=_FILE)
@click.option("--dance", type=_FILE, metavar="MOTION", help="A motion to the song. Default: a new dance.")
@click.option("--db", type=_FILE, multiple=True, metavar="FILE|DIR", help="Repertoire of a new dance.")
@click.option("--genre", help="Genre of a new dance.")
@click.option("--seed", default=0, show_default=True, help="Seed of a new dance.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Machine of the receiver.")
@click.option("--port", type=_PORTS, default=39539, show_default=True, help="UDP port of the receiver.")
@click.option("--fps", type=_RATES, default=60.0, show_default=True, help="Frames a second.")
@click.option("--silent", is_flag=True, help="Do not play the song here.")
def command(
    song: Path,
    dance: Path | None,
    db: tuple[Path, ...],
    genre: str | None,
    seed: int,
    host: str,
    port: int,
    fps: float,
    silent: bool,
) -> None:
    """Dance to SONG and send the body by the VMC protocol, a bundle of OSC over UDP for each frame.

    Receivers listen on UDP port 39539 unless they are told otherwise. Ctrl-C ends it.
    """
    from choreograph.formats.register import load_motion
    from choreograph.live.sound import playing
    from choreograph.live.sound import silent as not_heard
    from choreograph.live.stream import send_frames
    from choreograph.live.vmc import VmcBody
    from choreograph.music.song import load_song

    if dance is not None and (db or genre or seed):
        raise ParameterError("expected --dance or options of a new dance, got both: leave out one")
    with stages(quiet=False) as shown:
        if dance is not None:
            load_song(song)  # an error before anything is sent
            motion = load_motion(dance)
        else:
            from choreograph.library.builtin import as_repertoire
            from choreograph.pipeline.dancing import dance as make

            motion = make(song, as_repertoire(db), genre=genre, seed=seed, report=shown.report).motion
    body = VmcBody.of(motion.resampled(fps))
    try:
        address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as error:  # a UnicodeError for a name that no machine can have
        reason = getattr(error, "strerror", None) or "not a name of a machine"
        raise ChoreographError(f"expected the receiver's machine, got {host!r}: {reason}") from None
    clock = not_heard() if silent else playing(song)
    with socket.socket(address[0], socket.SOCK_DGRAM) as out, clock as song_s:
        say(f"sending {len(body) / fps:.1f} s to {host}:{port}, {fps:g} frames a second: Ctrl-C ends it")
        sent = send_frames(body, fps, lambda packet: _send(out, packet, address[4]), song_s=song_s)
    skipped = f", {sent.n_skipped} skipped" if sent.n_skipped else ""
    say(f"sent {sent.n_frames} frames{skipped}, at most {1000 * sent.latest_s:.1f} ms late")


def _send(out: socket.socket, packet: bytes, address: tuple[object, ...]) -> None:
    """Send a packet. A receiver that does not listen yet is not an error."""
    with suppress(ConnectionRefusedError):
        out.sendto(packet, address)
