"""Settings as frozen dataclasses. Presets are instances; nothing here computes."""

from __future__ import annotations

from dataclasses import dataclass

KMH = 1 / 3.6  # m/s in a km/h


@dataclass(frozen=True)
class CameraConfig:
    """A pinhole camera on the ego: image size in pixels, horizontal field of view in degrees, mounting.

    forward, left, up: metres from the car's centre at ground level; yaw: rad, + left. The default is the authors'
    800 x 600 camera with rows 120-480 kept, rendered straight at the network's size.
    """

    width: int = 200
    height: int = 88
    fov: float = 90.0
    forward: float = 1.44
    left: float = 0.0
    up: float = 1.2
    yaw: float = 0.0


@dataclass(frozen=True)
class VehicleConfig:
    """The ego: a compact car. Angles in rad, accelerations in m/s², times in s, mass in kg."""

    length: float = 4.2
    width: float = 1.8
    wheelbase: float = 2.6
    front_axle: float = 1.3  # m ahead of the centre
    max_steer: float = 0.6109  # 35°
    steer_rate: float = 2.0
    max_acceleration: float = 3.8  # at standstill; the thrust falls evenly to 0 at top_speed
    max_brake: float = 8.0
    top_speed: float = 45.0
    throttle_lag: float = 0.25
    brake_lag: float = 0.08
    max_lateral: float = 8.0  # m/s², what the tyres give before the car understeers
    drag: float = 0.0008  # 1/m
    rolling: float = 0.25
    mass: float = 1400.0


@dataclass(frozen=True)
class PIDGains:
    """Parallel form: kp per unit of error, ki per unit and second, kd in seconds per unit.

    low, high: limits of the output. filter_time: time constant in s of the low pass on the derivative.
    """

    kp: float
    ki: float
    kd: float = 0.0
    low: float = -1.0
    high: float = 1.0
    filter_time: float = 0.2


@dataclass(frozen=True)
class LongitudinalConfig:
    """The five states' thresholds and laws. Speeds in km/h, distances in m, patience and red_roll in s; see
    control/presets.py for the reasons."""

    cruise: PIDGains = PIDGains(0.09, 0.02, 0.0, low=-0.3)
    follow: PIDGains = PIDGains(0.09, 0.01, 0.0)
    turn_reduction: float = 0.0
    turn_speed: float = 15.0
    follow_distance: float = 45.0
    follow_c: float = 3.0
    follow_d: float = 0.0
    follow_gap: float = 5.5
    over_limit_margin: float = 3.0
    over_limit_ratio: float = 0.0
    over_limit_gain: float = 0.03
    red_threshold: float = 0.5
    red_gain: float = 1.5
    red_floor: float = 0.8
    hazard_threshold: float = 0.4
    hazard_patience: float = 15.0
    red_patience: float = 25.0
    red_roll: float = 1.2
    red_rolls: int = 2
    creep_speed: float = 4.0
    hold_speed: float = 1.0
    hold_brake: float = 0.3


@dataclass(frozen=True)
class LateralConfig:
    """The Stanley law: (gain in 1/s, damping) of each command, floor of the speed in m/s, largest angle in rad."""

    left: tuple[float, float] = (0.5, 0.05)
    right: tuple[float, float] = (1.0, 0.075)
    straight: tuple[float, float] = (1.0, 0.1)
    speed_floor: float = 2.0
    max_angle: float = 0.6109  # 35°


@dataclass(frozen=True)
class ControlConfig:
    """The controller. initial_limit: km/h before the first sign. cap: km/h that no limit exceeds, None for no cap.
    blind_brake: brake in [0, 1] where an affordance is not a number."""

    longitudinal: LongitudinalConfig = LongitudinalConfig()
    lateral: LateralConfig = LateralConfig()
    initial_limit: float = 30.0
    cap: float | None = None
    blind_brake: float = 0.5


@dataclass(frozen=True)
class CollectConfig:
    """What to record. weathers: by turns; the clear noon, when shadows are hardest, and the clear sunset, in which most
    is lost at junctions, come twice as often. duration: s of an episode, which is short, as every place and look tells
    most at first; of the time in which the car stands only a part counts. cars: in half of the episodes; the others
    have a third of them, and tailgating ones twice as many. crossing: how much more people cross than usual.

    Shares of the episodes: tailgating ones begin anywhere, and their driver comes close to the cars ahead, at 20 km/h
    at most, for up to six times the duration until he met enough; of the others, before_signs and before_turns begin
    before a sign and before a turn at a junction, and hidden_cars have a driver who is told of no car ahead. displaced
    begin beside their lane; rearranged have other houses, trees and colours along the same streets. semantic: a
    semantic image of each frame.
    """

    town: str = "town01"
    weathers: tuple[int, ...] = (1, 8, 3, 1, 8, 6)
    episodes: int = 1800
    duration: float = 12.0
    cars: int = 75
    people: int = 70
    crossing: float = 5.0
    before_signs: float = 0.35
    before_turns: float = 0.5
    displaced: float = 0.3
    rearranged: float = 0.85
    hidden_cars: float = 0.1
    tailgating: float = 0.2
    width: int = 200
    height: int = 88
    semantic: bool = False
    seed: int = 0


@dataclass(frozen=True)
class BlockConfig:
    """A task block: kind of layer (dense, lstm, gru or tconv), its nodes (for each command where the affordance is
    conditional), dropout ratio, length of its sequence in frames, dilation (2: every other frame), and its norm.

    norm: batch; layer (over a sample's nodes), for conditional blocks, whose batch norm would see only the few samples
    of a batch that have its command; or none, where a small network's nodes die one after the other: features are
    never negative, and a few steps at its high rate push all of a node's sums below zero for good.
    """

    layer: str = "dense"
    nodes: int = 64
    dropout: float = 0.25
    length: int = 1
    dilation: int = 1
    norm: str = "batch"

    @property
    def span(self) -> int:
        """Frames from the oldest one that the block looks at to the newest, both included."""
        return (self.length - 1) * self.dilation + 1


@dataclass(frozen=True)
class PerceptionConfig:
    """The network: image size in pixels, width of the convolutions as a share of VGG16's, batch norm in the backbone,
    and one task block for each affordance. The default is the small network that is trained from scratch."""

    image_width: int = 200
    image_height: int = 88
    width: float = 0.25
    batch_norm: bool = True
    hazard_stop: BlockConfig = BlockConfig("tconv", 64, 0.25, length=5, dilation=2)
    red_light: BlockConfig = BlockConfig("dense", 64, 0.25)
    speed_sign: BlockConfig = BlockConfig("dense", 64, 0.25)
    vehicle_distance: BlockConfig = BlockConfig("dense", 64, 0.1)
    relative_angle: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")
    center_distance: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")


PERCEPTIONS = {
    "small": PerceptionConfig(),
    # The best task blocks of the paper's supplement (table of best task block parameters) on VGG16 as it is.
    "paper": PerceptionConfig(
        image_width=320,
        image_height=144,
        width=1.0,
        batch_norm=False,
        hazard_stop=BlockConfig("tconv", 160, 0.68, length=6),
        red_light=BlockConfig("gru", 185, 0.27, length=14, dilation=2),
        speed_sign=BlockConfig("dense", 160, 0.55),
        vehicle_distance=BlockConfig("gru", 160, 0.38, length=11),
        relative_angle=BlockConfig("tconv", 100, 0.44, length=10),
        center_distance=BlockConfig("tconv", 100, 0.44, length=10),
    ),
}


@dataclass(frozen=True)
class TrainingConfig:
    """How the network learns: Adam with a warm-up and a cosine down to final_rate times the base rate.

    batch: windows a step; window: consecutive frames of each that give a loss; clip: largest norm of the gradient.
    muon: the backbone's convolutions learn by Muon (`perception/optimizer.py`) at this many times the rate; 0: by Adam.
    angle_weight, segmentation: what the relative angle's loss and the second lesson's (where the recording has semantic
    images; 0 leaves it out) count while the backbone learns; the other affordances' count 1.
    block_steps: after the others, steps in which the task blocks that look back learn alone, from block_batch windows
    with their history, whose frames the finished backbone saw once; until then a window is seen as if its stream began
    there. 0: the blocks see their history from the first step on.
    balance: 0 draws windows evenly, 1 in inverse proportion to the frequency of the rarest label in them.
    cache_gb: decoded images are kept in memory up to this size. precision: auto, fp32 or bf16. device: cpu, cuda, or
    auto for a GPU where there is one. initial: file of the network to begin with, None for a new one.
    """

    steps: int = 11_000
    batch: int = 64
    window: int = 1
    learning_rate: float = 1e-3
    muon: float = 0.0
    warm_up: int = 100
    final_rate: float = 0.02
    clip: float = 5.0
    balance: float = 0.5
    augment: bool = True
    angle_weight: float = 1.0
    segmentation: float = 0.5
    block_steps: int = 3_000
    block_batch: int = 256
    validation_share: float = 0.05
    evaluate_every: int = 2000
    save_every: int = 100
    cache_gb: float = 4.0
    precision: str = "auto"
    device: str = "auto"
    initial: str | None = None
    seed: int = 0


TRAININGS = {
    "small": TrainingConfig(muon=20.0, angle_weight=5.0),
    # Section 3.1: Adam, mini-batches of 32 sequences, base rate 5e-5.
    "paper": TrainingConfig(
        steps=75_000, batch=32, learning_rate=5e-5, warm_up=0, final_rate=1.0, balance=0.0, block_steps=0
    ),
}
