"""Sizes and training lengths of the networks of a repertoire, without torch: `paper`, `small` and `tiny`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from choreograph.core.arguments import check_choice, unexpected
from choreograph.core.errors import ParameterError

# Presets of network configurations, with fields changed by name.


Config = TypeVar("Config", bound=Any)  # a frozen dataclass
_MAX_ITEMS = 16  # of a field of several values
_MAX_SIZE = 1e9  # of a number in a configuration
MAX_DEPTH = 64  # layers, or blocks of layers, of a network that a file configures
DEVICES = ("auto", "cpu", "cuda")  # to train on. auto is a GPU if there is one
SCHEDULES = ("cosine", "constant")  # of a learning rate: warm-up and half a cosine to zero, or neither


def check_training(epochs: int, schedule: str) -> None:
    """Raise `ParameterError` for a number of epochs below 0, or an unknown schedule."""
    if epochs < 0:
        raise ParameterError(f"expected 0 epochs (steps count) or more, got {epochs}")
    if schedule not in SCHEDULES:
        raise ParameterError(f"expected a schedule among {', '.join(SCHEDULES)}, got {schedule!r}")


def config_from_preset(presets: Mapping[str, Config], preset: str, changes: Mapping[str, Any]) -> Config:
    """One of `presets` with fields changed. Raises `ParameterError` if a name or value is not valid."""
    check_choice("a preset", preset, presets)
    config = presets[preset]
    return replace(config, **check_fields(type(config), changes))


def check_fields(config_class: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the fields of a configuration. Lists, which JSON has, become tuples.

    Raises `ParameterError` unless each is of the kind of its field's default, and finite.
    """
    defaults = {field.name: field.default for field in fields(config_class)}
    unknown = [name for name in values if name not in defaults]
    if unknown:
        listed = ", ".join(sorted(map(str, unknown)))
        raise ParameterError(f"expected fields of {config_class.__name__}, got {listed}")
    checked = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    for name, value in checked.items():
        if not _is_like(value, defaults[name]):
            raise unexpected(f"{name} of {config_class.__name__} as {defaults[name]!r} is", value)
    return checked


def _is_like(value: Any, default: Any) -> bool:
    if isinstance(default, tuple):
        is_short = isinstance(value, tuple) and 0 < len(value) <= _MAX_ITEMS
        return is_short and all(_is_like(item, default[0]) for item in value)
    if isinstance(default, bool | str):
        return type(value) is type(default)
    kinds = int | float if isinstance(default, float) else int
    return isinstance(value, kinds) and not isinstance(value, bool) and abs(value) <= _MAX_SIZE


# Sizes and training lengths of the style networks: `paper`, `small` (two CPU cores), `tiny` (tests).
#
# The paper states numbers of layers and shapes of inputs and outputs. The widths are ours.


STYLE_DIM = 32  # of style vectors
MUSIC_INPUTS = ("mel", "counts", "mel+counts")
STYLE_LOSSES = ("paper", "contrastive")
N_SONGS = 32  # for which the steps of the presets are meant


@dataclass(frozen=True)
class StyleConfig:
    """Sizes and training settings of the style networks, which are stored with their weights."""

    conv_channels: tuple[int, int, int, int] = (8, 16, 16, 16)  # music: four convolutional blocks over mel
    graph_channels: tuple[int, int, int, int] = (8, 16, 16, 32)  # motion: four graph blocks
    gru_width: int = 32  # of both layers of each network
    rhythm_width: int = 32  # hidden and output width of the rhythm branch
    head_width: int = 32  # of the four linear layers of the beat-count head
    dropout: float = 0.3  # in both networks
    # "mel" is the input of the paper. "counts" is the rhythm relative to the counts of the song. Adding mel
    # to it does not help.
    music_inputs: str = "counts"
    loss: str = "contrastive"  # "paper" is equation 1 alone, which constant embeddings minimise
    style_weight: float = 0.2  # λ of the style distance in equation 1
    beat_weight: float = 0.05  # λ of the beat count in equation 1, per beat
    contrast_weight: float = 0.3  # contrast of a pair against pairs of other songs
    genre_weight: float = 1.0  # contrast of a genre against the others, if takes state their genre
    temperature: float = 0.2  # of squared distances between unit vectors
    normalised: bool = True  # normalise the last features and the vectors. The paper's are not normalised
    augmented: bool = True  # augment the music and motion of the samples, which the paper does not
    mirrored_share: float = 0.5  # of the augmented motion, or 0 where left and right must stay distinct
    balanced_genres: bool = True  # draw each genre equally often, or else every second of the takes
    batch_size: int = 32  # samples of a step
    steps: int = 220  # for up to `N_SONGS` songs: see `style_config`
    epochs: int = 0  # passes over the takes, which replace `steps` unless 0
    schedule: str = "cosine"  # of the learning rate: see `nets.training.train`
    learning_rate: float = 5e-3  # at its highest
    weight_decay: float = 1e-2  # of AdamW, or 0 for Adam

    def __post_init__(self) -> None:
        if self.music_inputs not in MUSIC_INPUTS:
            raise ParameterError(
                f"expected music_inputs among {', '.join(MUSIC_INPUTS)}, got {self.music_inputs!r}"
            )
        if self.loss not in STYLE_LOSSES:
            raise ParameterError(f"expected a style loss among {', '.join(STYLE_LOSSES)}, got {self.loss!r}")
        check_training(self.epochs, self.schedule)
        if self.steps < 1 or self.batch_size < 2:
            raise ParameterError(
                f"expected at least 1 step and batches of 2, got {self.steps} and {self.batch_size}"
            )


_STYLE_PRESETS = {
    "paper": StyleConfig(
        conv_channels=(32, 64, 128, 128),
        graph_channels=(64, 64, 128, 128),
        gru_width=256,
        rhythm_width=128,
        head_width=128,
        batch_size=256,
        steps=20_000,
        learning_rate=5e-4,
    ),
    "small": StyleConfig(),
    "tiny": StyleConfig(
        conv_channels=(4, 8, 8, 8), graph_channels=(8, 8, 8, 16), gru_width=16, batch_size=16, steps=100
    ),
}


def style_config(preset: str, *, n_songs: int = 0, **changes: Any) -> StyleConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field.

    The steps are meant for `N_SONGS` songs. With more songs (`n_songs`), there are proportionally more steps,
    so that each song is used equally often. With 119 songs in 220 steps, the genres were not separated.
    """
    config = config_from_preset(_STYLE_PRESETS, preset, changes)
    return replace(config, steps=round(config.steps * max(1.0, n_songs / N_SONGS)))


# Sizes and training lengths of the tempo-density networks: `paper`, `small` (one CPU core), `tiny` (tests).
#
# The paper states numbers of layers, a hidden vector of 4096 and a content of 1024. Other widths are ours.


DENSITY_LOSSES = ("paper", "locatable")
HIDDEN_FRAMES = 4  # of the hidden vector


@dataclass(frozen=True)
class DensityConfig:
    """Sizes and training settings of both tempo-density networks, which are stored with their weights."""

    width: int = 32  # of the transformer layers
    conv_channels: tuple[int, int, int, int, int] = (32, 32, 48, 64, 128)  # hidden vector: 4 x the last
    content_dim: int = 128  # numbers that describe a clip without its timing
    loss: str = "locatable"  # "paper" is equation 2 alone, which does not determine the density
    reconstruction_weight: float = 1.0  # of equation 2
    content_weight: float = 0.1  # λ of equation 2
    equivariance_weight: float = 1.0  # of the difference of warped densities to densities of warped motion
    location_weight: float = 1.0  # of the term that locates warped frames in the density
    temperature: float = 0.1  # of the location term, for squared differences of curves of unit variance
    velocities: bool = True  # use velocities of joints beside positions. The paper uses positions alone
    skips: bool = (
        True  # from each convolution block to the deconvolution block of its rate. The paper has none
    )
    unit_variance: bool = True  # scale every density to unit variance. The paper does not state a scale
    augmented: bool = True  # augment clips and music of the samples. The paper only warps clips in time
    mirrored_share: float = 0.5  # of the augmented motion, or 0 where left and right must stay distinct
    batch_size: int = 16  # clips of a step of the network of motion
    steps: int = 1500  # of the network of motion
    learning_rate: float = 2e-3  # at its highest, of the network of motion
    weight_decay: float = 1e-3  # of AdamW, or 0 for Adam
    music_channels: tuple[int, int, int, int, int] = (32, 32, 48, 64, 64)  # as `conv_channels`
    music_batch_size: int = 16  # samples of a step of the network of music
    music_steps: int = 1500  # of the network of music
    music_learning_rate: float = 1e-3  # at its highest, of the network of music
    synchronise: bool = True  # warp motion beats of targets onto music beats. The paper's targets are raw
    music_target: str = "take"  # density of the whole take, or "clip": of each clip alone, as in the paper
    epochs: int = 0  # passes of both networks over the takes, which replace `steps` unless 0
    schedule: str = "cosine"  # of the learning rate: see `nets.training.train`

    @property
    def hidden_dim(self) -> int:
        """Size of the hidden vector."""
        return HIDDEN_FRAMES * self.conv_channels[-1]

    def __post_init__(self) -> None:
        if self.loss not in DENSITY_LOSSES:
            raise ParameterError(
                f"expected a density loss among {', '.join(DENSITY_LOSSES)}, got {self.loss!r}"
            )
        check_choice("a music target", self.music_target, ("take", "clip"))
        if self.music_target == "clip" and self.synchronise:
            raise ParameterError("expected raw targets of clips, got music_target clip with synchronise")
        check_training(self.epochs, self.schedule)
        if self.width < 4 or self.width % 4:
            raise ParameterError(f"expected a width divisible by the 4 attention heads, got {self.width}")
        if min(self.steps, self.music_steps) < 1 or min(self.batch_size, self.music_batch_size) < 2:
            raise ParameterError(
                "expected steps of 1 or more and batches of 2 or more, got "
                f"{self.steps}, {self.music_steps}, {self.batch_size} and {self.music_batch_size}"
            )


_DENSITY_PRESETS = {
    "paper": DensityConfig(
        width=256,
        conv_channels=(64, 128, 256, 512, 1024),
        content_dim=1024,
        batch_size=64,
        steps=50_000,
        learning_rate=3e-4,
        music_channels=(64, 128, 256, 512, 512),
        music_batch_size=64,
        music_steps=20_000,
        music_learning_rate=3e-4,
    ),
    "small": DensityConfig(),
    "tiny": DensityConfig(
        width=16,
        conv_channels=(16, 16, 16, 24, 32),
        content_dim=32,
        batch_size=8,
        steps=300,
        music_channels=(8, 16, 16, 16, 16),
        music_batch_size=8,
        music_steps=80,
        synchronise=False,  # saves tracking the beats of every take
    ),
}


def density_config(preset: str, **changes: Any) -> DensityConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_DENSITY_PRESETS, preset, changes)


# Sizes and training lengths of the motion-word network: `paper`, `small` (two CPU cores), `tiny` (tests).
#
# The paper states 184 dimensions and uses an earlier network. The architecture is ours.


WORD_DIM = 184  # of embeddings
_MANY_WORDS = 1000  # from which on all steps of a preset are trained: 100 passes of the preset small
_FEWEST_STEPS = 300  # unless the preset has fewer
_STEPS_FROM_PRETRAINED = 150  # as good as 800 from nothing (`research/results/rhythm_is_a_dancer.md`)


@dataclass(frozen=True)
class WordConfig:
    """Sizes and training settings of the motion-word network, which are stored with its weights."""

    width: int = 64  # channels of the temporal convolutions
    n_blocks: int = 2  # of temporal convolutions
    same_m: float = 0.04  # width of the kernel: words that are much nearer count as the same
    contrast_weight: float = 0.1  # of the contrast between copies of words
    distance_weight: float = 1.0  # of the difference between embedding distances and mean joint distances
    mirrored_share: float = 0.5  # of the motion samples, or 0 where left and right must stay distinct
    batch_size: int = 128  # samples of a step
    steps: int = 800  # of the training
    learning_rate: float = 5e-4  # at its highest
    weight_decay: float = 1e-3  # of AdamW, or 0 for Adam

    def __post_init__(self) -> None:
        if min(self.steps, self.width) < 1 or not 1 <= self.n_blocks <= MAX_DEPTH or self.batch_size < 2:
            raise ParameterError(
                f"expected steps, width and blocks (to {MAX_DEPTH}) of 1 or more, batches of 2 or more, got "
                f"{self.steps}, {self.width}, {self.n_blocks} and {self.batch_size}"
            )
        if self.same_m <= 0 or min(self.contrast_weight, self.distance_weight) < 0:
            raise ParameterError(
                "expected same_m above 0 and weights of 0 or more, got "
                f"{self.same_m}, {self.contrast_weight} and {self.distance_weight}"
            )


_WORD_PRESETS = {
    "paper": WordConfig(width=512, n_blocks=4, batch_size=512, steps=20_000, learning_rate=2e-4),
    "small": WordConfig(),
    "tiny": WordConfig(width=32, n_blocks=1, batch_size=32, steps=100),
}


def word_config(
    preset: str, *, n_words: int | None = None, pretrained: bool = False, **changes: Any
) -> WordConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field.

    A training that starts from a trained network (`pretrained`) has at most 150 steps. A training on fewer
    than 1,000 words (`n_words`) has proportionally fewer steps, but at least 300. More passes over few words
    hardly change how near the words are that the network finds in other takes.
    """
    config = config_from_preset(_WORD_PRESETS, preset, changes)
    if "steps" in changes:
        return config
    if pretrained:
        return replace(config, steps=min(config.steps, _STEPS_FROM_PRETRAINED))
    if n_words is None:
        return config
    fewer = max(_FEWEST_STEPS, round(config.steps * n_words / _MANY_WORDS))
    return replace(config, steps=min(config.steps, fewer))


# Sizes and training of the rollout network: `paper`, `small` (two CPU cores), `tiny` (tests).


@dataclass(frozen=True)
class RolloutConfig:
    """Sizes and training settings of the rollout network, which are stored with its weights.

    In the paper, there is one network for each genre, conditions enter the LSTM as they are, motifs are
    medoids only, 5 teacher-forced frames alternate with 5 self-fed frames, and the loss is that of equation
    10. `choreograph.pipeline.published.ROLLOUT` lists these values. The other settings are ours.
    """

    n_joints: int = 24  # of the takes' skeleton, set by the training
    by_genre: bool = False  # one network for each genre instead of one for all
    genre: str = ""  # of the takes of a network `by_genre`, set by the training
    width: int = 256  # of the LSTM
    n_layers: int = 2  # of the LSTM
    condition_width: int = 192  # of the embedded conditions, or 0: they enter the LSTM as they are
    standardised: bool = True  # conditions and the motion of the root
    use_audio: bool = True  # rhythm and phases. False is the ablation without audio
    motifs: bool = True  # False is the acLSTM baseline
    phase: bool = True  # condition on the phase in the word and its duration, which the paper does not
    count_phase: bool = True  # condition on the phase in the beat and in the bar
    own_embedding_share: float = 0.5  # of sequences that are conditioned on their own words, not on medoids
    style_strength: float = 1.5  # β of equation 4
    style_fade_s: float = 1.0  # of the transition between styles of words, or 0 for the paper's window
    style_dropout: float = 0.5  # share of sequences without style
    loss: str = "weighted"  # all of the weights below, or "paper": equation 10
    perceptual_weight: float = 0.5  # λ of equation 10
    position_weight: float = 2.0  # of joint positions
    velocity_weight: float = 0.3  # of joint velocities
    root_weight: float = 0.1  # of the motion of the root
    contact_weight: float = 0.05  # of predicted foot contacts
    slide_weight: float = 0.2  # of the speed of feet in contact
    border_speed_weight: float = 0.3  # of the speed of joints where words meet
    tempi: tuple[float, ...] = (0.8, 0.9, 1.0, 1.11, 1.25)  # at which takes are played, relative to their own
    frames: int = 75  # of a training sequence
    teacher_frames: int = 5  # with teacher forcing, before each run of self-fed frames
    self_fed_frames: tuple[int, ...] = (5, 15, 60)  # with the network's own poses as input, drawn per batch
    batch_size: int = 32  # samples of a step
    steps: int = 1500  # of the training
    learning_rate: float = 1e-3  # at its highest
    weight_decay: float = 1e-4  # of AdamW, or 0 for Adam
    schedule: str = "cosine"  # of the learning rate, after a warm-up, or "constant"

    def __post_init__(self) -> None:
        sizes = (self.n_joints, self.width, self.n_layers, self.condition_width + 1, self.teacher_frames)
        if min(*sizes, *self.self_fed_frames, self.batch_size, self.steps) < 1 or self.frames < 2:
            raise ParameterError(f"expected sizes of 1 or more and sequences of 2 frames or more, got {self}")
        if self.n_layers > MAX_DEPTH:
            raise ParameterError(f"expected at most {MAX_DEPTH} layers, got {self.n_layers}")
        check_choice("a loss", self.loss, ("weighted", "paper"))
        check_choice("a schedule", self.schedule, ("cosine", "constant"))
        if not self.tempi or min(self.tempi) <= 0:
            raise ParameterError(f"expected tempi above 0, got {self.tempi}")
        if not (0 <= self.own_embedding_share <= 1 and 0 <= self.style_dropout <= 1):
            raise ParameterError(
                f"expected shares from 0 to 1, got {self.own_embedding_share} and {self.style_dropout}"
            )


_ROLLOUT_PRESETS = {
    "paper": RolloutConfig(
        width=1024, n_layers=3, condition_width=512, frames=100, self_fed_frames=(5,), steps=500_000,
        learning_rate=1e-4, style_fade_s=0.0, style_strength=40.0,
    ),
    "small": RolloutConfig(),
    "tiny": RolloutConfig(
        width=48, n_layers=1, condition_width=32, frames=40, self_fed_frames=(5, 15), batch_size=8, steps=40
    ),
}  # fmt: skip


_TEMPI_TAUGHT = (0.7, 0.8, 0.9, 1.0, 1.11, 1.25, 1.45)


def taught(config: RolloutConfig) -> RolloutConfig:
    """The configuration for training on dances as well as takes: more steps, and more tempi.

    More tempi are needed because a song can be 1.5 times as fast as any take of its genre.
    """
    return replace(config, steps=2 * config.steps, tempi=_TEMPI_TAUGHT)


def rollout_config(preset: str, **changes: Any) -> RolloutConfig:
    """The preset with fields changed. Raises `ParameterError` for an unknown name or field."""
    return config_from_preset(_ROLLOUT_PRESETS, preset, changes)
