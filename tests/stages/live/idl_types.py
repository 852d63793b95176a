"""ROS 2 messages as CycloneDDS' own IDL types: a decoder that shares nothing with omninav's."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int8, int32, sequence, uint8, uint32


@dataclass
class Time(IdlStruct):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct):
    stamp: Time
    frame_id: str


@dataclass
class Point(IdlStruct):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class PoseWithCovarianceStamped(IdlStruct):
    header: Header
    pose: PoseWithCovariance


@dataclass
class PoseStamped(IdlStruct):
    header: Header
    pose: Pose


@dataclass
class Path(IdlStruct):
    header: Header
    poses: sequence[PoseStamped]


@dataclass
class PoseArray(IdlStruct):
    header: Header
    poses: sequence[Pose]


@dataclass
class Particle(IdlStruct):
    pose: Pose
    weight: float64


@dataclass
class ParticleCloud(IdlStruct):
    header: Header
    particles: sequence[Particle]


@dataclass
class Transform(IdlStruct):
    translation: Point
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct):
    transforms: sequence[TransformStamped]


@dataclass
class Twist(IdlStruct):
    linear: Point
    angular: Point


@dataclass
class TwistStamped(IdlStruct):
    header: Header
    twist: Twist


@dataclass
class Float64(IdlStruct):
    data: float64


@dataclass
class String(IdlStruct):
    data: str


@dataclass
class MapMetaData(IdlStruct):
    map_load_time: Time
    resolution: float32
    width: uint32
    height: uint32
    origin: Pose


@dataclass
class OccupancyGrid(IdlStruct):
    header: Header
    info: MapMetaData
    data: sequence[int8]


@dataclass
class KeyValue(IdlStruct):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class ColorRGBA(IdlStruct):
    r: float32
    g: float32
    b: float32
    a: float32


@dataclass
class CompressedImage(IdlStruct):
    header: Header
    format: str
    data: sequence[uint8]


@dataclass
class UVCoordinate(IdlStruct):
    u: float32
    v: float32


@dataclass
class MeshFile(IdlStruct):
    filename: str
    data: sequence[uint8]


@dataclass
class Marker(IdlStruct):
    header: Header
    ns: str
    id: int32
    type: int32
    action: int32
    pose: Pose
    scale: Point
    color: ColorRGBA
    lifetime: Time
    frame_locked: bool
    points: sequence[Point]
    colors: sequence[ColorRGBA]
    texture_resource: str
    texture: CompressedImage
    uv_coordinates: sequence[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool


@dataclass
class MarkerArray(IdlStruct):
    markers: sequence[Marker]
