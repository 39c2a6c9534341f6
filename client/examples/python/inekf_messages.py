"""The messages of the estimation daemon. Written by `inekf-client layout --python`: do not edit.

SI units and radians; world east-north-up, body forward-left-up; quaternions x, y, z, w, body to world.
Meaning, unit and frame of every field: the documentation of the Rust module inekf_shared::message.
"""

import ctypes
import os

ESTIMATE_PROPAGATED = 1
ESTIMATE_UPDATED = 2
ESTIMATE_RESET = 4
ESTIMATE_DEGRADED = 8
ESTIMATE_REPLAYED = 16
ESTIMATE_RESUMED = 32
ESTIMATE_SMOOTHED = 64
SMOOTHED_CUT = 1
MODEL_IMU = 1
MODEL_ODOMETRY_3D = 2
MODEL_ODOMETRY_2D = 3
NO_SOURCE = 4294967295
ZERO_VELOCITY_SOURCE = 4294967294
NO_MODE = 4294967295
STATE_WAITING = 1
STATE_ALIGNING = 2
STATE_RUNNING = 3
STATE_DEGRADED = 4
STATE_STALE = 5
STATE_PAUSED = 6
WAITING_FOR_NOTHING = 0
WAITING_FOR_IMU = 1
WAITING_FOR_POSITION = 2
WAITING_FOR_LEVEL = 3
WAITING_FOR_REQUEST = 4
CONTROL_RESET = 1
CONTROL_SET_STATE = 2
CONTROL_SNAPSHOT = 3
CONTROL_BARRIER = 4
CONTROL_SMOOTHED = 5
CONTROL_PAUSE = 6
CONTROL_RESUME = 7
CONTROL_RELOAD_NOISE = 8
CONTROL_CONFIG = 9
CONTROL_TAKE = 10
CONTROL_OK = 0
CONTROL_REFUSED = 1


class Header(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("seq", ctypes.c_uint64),
        ("sent_ns", ctypes.c_uint64),
        ("epoch", ctypes.c_uint64),
    ]
    SIZE, ALIGN = 32, 8
    OFFSETS = [
        ("stamp_ns", 0),
        ("seq", 8),
        ("sent_ns", 16),
        ("epoch", 24),
    ]

    @staticmethod
    def type_name():
        return "inekf.Header.v1"


class ImuSample(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("gyro_rps", ctypes.c_double * 3),
        ("accel_mps2", ctypes.c_double * 3),
    ]
    SIZE, ALIGN = 80, 8
    OFFSETS = [
        ("header", 0),
        ("gyro_rps", 32),
        ("accel_mps2", 56),
    ]

    @staticmethod
    def type_name():
        return "inekf.ImuSample.v1"


class Odometry2d(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("dtheta_rad", ctypes.c_double),
        ("translation_m", ctypes.c_double * 2),
    ]
    SIZE, ALIGN = 56, 8
    OFFSETS = [
        ("header", 0),
        ("dtheta_rad", 32),
        ("translation_m", 40),
    ]

    @staticmethod
    def type_name():
        return "inekf.Odometry2d.v1"


class Odometry3d(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("rotation_rad", ctypes.c_double * 3),
        ("translation_m", ctypes.c_double * 3),
    ]
    SIZE, ALIGN = 80, 8
    OFFSETS = [
        ("header", 0),
        ("rotation_rad", 32),
        ("translation_m", 56),
    ]

    @staticmethod
    def type_name():
        return "inekf.Odometry3d.v1"


class PositionFix(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("source", ctypes.c_uint32),
        ("dimension", ctypes.c_uint32),
        ("position_w_m", ctypes.c_double * 3),
        ("covariance_w_m2", ctypes.c_double * 9),
    ]
    SIZE, ALIGN = 136, 8
    OFFSETS = [
        ("header", 0),
        ("source", 32),
        ("dimension", 36),
        ("position_w_m", 40),
        ("covariance_w_m2", 64),
    ]

    @staticmethod
    def type_name():
        return "inekf.PositionFix.v1"


class VelocityFix(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("source", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("velocity_w_mps", ctypes.c_double * 3),
        ("covariance_w", ctypes.c_double * 9),
    ]
    SIZE, ALIGN = 136, 8
    OFFSETS = [
        ("header", 0),
        ("source", 32),
        ("flags", 36),
        ("velocity_w_mps", 40),
        ("covariance_w", 64),
    ]

    @staticmethod
    def type_name():
        return "inekf.VelocityFix.v1"


class HeadingFix(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("source", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("heading_rad", ctypes.c_double),
        ("sigma_rad", ctypes.c_double),
    ]
    SIZE, ALIGN = 56, 8
    OFFSETS = [
        ("header", 0),
        ("source", 32),
        ("flags", 36),
        ("heading_rad", 40),
        ("sigma_rad", 48),
    ]

    @staticmethod
    def type_name():
        return "inekf.HeadingFix.v1"


class Counters(ctypes.Structure):
    _fields_ = [
        ("accepted", ctypes.c_uint64),
        ("gated", ctypes.c_uint64),
        ("late", ctypes.c_uint64),
        ("lost", ctypes.c_uint64),
        ("rejected", ctypes.c_uint64),
        ("unpaired", ctypes.c_uint64),
    ]
    SIZE, ALIGN = 48, 8
    OFFSETS = [
        ("accepted", 0),
        ("gated", 8),
        ("late", 16),
        ("lost", 24),
        ("rejected", 32),
        ("unpaired", 40),
    ]

    @staticmethod
    def type_name():
        return "inekf.Counters.v2"


class EstimateHead(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("seq", ctypes.c_uint64),
        ("sent_ns", ctypes.c_uint64),
        ("received_ns", ctypes.c_uint64),
        ("published_ns", ctypes.c_uint64),
        ("estimate_seq", ctypes.c_uint64),
        ("reset_count", ctypes.c_uint64),
        ("reset_jump_m", ctypes.c_double),
        ("flags", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("source", ctypes.c_uint32),
        ("dimension", ctypes.c_uint32),
        ("active_mismatches", ctypes.c_uint32),
        ("mode", ctypes.c_uint32),
        ("counters", Counters),
        ("nis", ctypes.c_double * 8),
    ]
    SIZE, ALIGN = 200, 8
    OFFSETS = [
        ("stamp_ns", 0),
        ("seq", 8),
        ("sent_ns", 16),
        ("received_ns", 24),
        ("published_ns", 32),
        ("estimate_seq", 40),
        ("reset_count", 48),
        ("reset_jump_m", 56),
        ("flags", 64),
        ("state", 68),
        ("source", 72),
        ("dimension", 76),
        ("active_mismatches", 80),
        ("mode", 84),
        ("counters", 88),
        ("nis", 136),
    ]

    @staticmethod
    def type_name():
        return "inekf.EstimateHead.v2"


class EstimateSe23(ctypes.Structure):
    _fields_ = [
        ("head", EstimateHead),
        ("q_wb", ctypes.c_double * 4),
        ("v_w_mps", ctypes.c_double * 3),
        ("p_w_m", ctypes.c_double * 3),
        ("gyro_bias_rps", ctypes.c_double * 3),
        ("accel_bias_mps2", ctypes.c_double * 3),
        ("covariance", ctypes.c_double * 120),
    ]
    SIZE, ALIGN = 1288, 8
    OFFSETS = [
        ("head", 0),
        ("q_wb", 200),
        ("v_w_mps", 232),
        ("p_w_m", 256),
        ("gyro_bias_rps", 280),
        ("accel_bias_mps2", 304),
        ("covariance", 328),
    ]

    @staticmethod
    def type_name():
        return "inekf.EstimateSe23.v2"


class EstimateSe3(ctypes.Structure):
    _fields_ = [
        ("head", EstimateHead),
        ("q_wb", ctypes.c_double * 4),
        ("p_w_m", ctypes.c_double * 3),
        ("covariance", ctypes.c_double * 21),
        ("mismatch", ctypes.c_double * 6),
        ("mismatch_sigma", ctypes.c_double * 6),
    ]
    SIZE, ALIGN = 520, 8
    OFFSETS = [
        ("head", 0),
        ("q_wb", 200),
        ("p_w_m", 232),
        ("covariance", 256),
        ("mismatch", 424),
        ("mismatch_sigma", 472),
    ]

    @staticmethod
    def type_name():
        return "inekf.EstimateSe3.v2"


class EstimateSe2(ctypes.Structure):
    _fields_ = [
        ("head", EstimateHead),
        ("theta_rad", ctypes.c_double),
        ("p_w_m", ctypes.c_double * 2),
        ("covariance", ctypes.c_double * 6),
        ("mismatch", ctypes.c_double * 6),
        ("mismatch_sigma", ctypes.c_double * 6),
    ]
    SIZE, ALIGN = 368, 8
    OFFSETS = [
        ("head", 0),
        ("theta_rad", 200),
        ("p_w_m", 208),
        ("covariance", 224),
        ("mismatch", 272),
        ("mismatch_sigma", 320),
    ]

    @staticmethod
    def type_name():
        return "inekf.EstimateSe2.v2"


class SmoothedState(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("request_id", ctypes.c_uint64),
        ("index", ctypes.c_uint64),
        ("count", ctypes.c_uint64),
        ("dimension", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("q_wb", ctypes.c_double * 4),
        ("v_w_mps", ctypes.c_double * 3),
        ("p_w_m", ctypes.c_double * 3),
        ("gyro_bias_rps", ctypes.c_double * 3),
        ("accel_bias_mps2", ctypes.c_double * 3),
        ("covariance", ctypes.c_double * 120),
    ]
    SIZE, ALIGN = 1128, 8
    OFFSETS = [
        ("stamp_ns", 0),
        ("request_id", 8),
        ("index", 16),
        ("count", 24),
        ("dimension", 32),
        ("flags", 36),
        ("q_wb", 40),
        ("v_w_mps", 72),
        ("p_w_m", 96),
        ("gyro_bias_rps", 120),
        ("accel_bias_mps2", 144),
        ("covariance", 168),
    ]

    @staticmethod
    def type_name():
        return "inekf.SmoothedState.v2"


class Health(ctypes.Structure):
    _fields_ = [
        ("stamp_ns", ctypes.c_uint64),
        ("uptime_ns", ctypes.c_uint64),
        ("instance_pid", ctypes.c_uint64),
        ("state", ctypes.c_uint32),
        ("waiting_for", ctypes.c_uint32),
        ("model", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("last_imu_stamp_ns", ctypes.c_uint64),
        ("imu_rate_hz", ctypes.c_double),
        ("counters", Counters),
        ("rejected_by_reason", ctypes.c_uint64 * 16),
        ("received", ctypes.c_uint64 * 6),
        ("checkpoints", ctypes.c_uint64),
        ("checkpoint_failures", ctypes.c_uint64),
        ("journal_failures", ctypes.c_uint64),
        ("last_fix_stamp_ns", ctypes.c_uint64),
        ("last_delivery_ns", ctypes.c_uint64),
        ("fused_stamp_ns", ctypes.c_uint64 * 24),
        ("delivered_ns", ctypes.c_uint64 * 24),
        ("stalls", ctypes.c_uint64),
        ("longest_stall_ns", ctypes.c_uint64),
    ]
    SIZE, ALIGN = 720, 8
    OFFSETS = [
        ("stamp_ns", 0),
        ("uptime_ns", 8),
        ("instance_pid", 16),
        ("state", 24),
        ("waiting_for", 28),
        ("model", 32),
        ("flags", 36),
        ("last_imu_stamp_ns", 40),
        ("imu_rate_hz", 48),
        ("counters", 56),
        ("rejected_by_reason", 104),
        ("received", 232),
        ("checkpoints", 280),
        ("checkpoint_failures", 288),
        ("journal_failures", 296),
        ("last_fix_stamp_ns", 304),
        ("last_delivery_ns", 312),
        ("fused_stamp_ns", 320),
        ("delivered_ns", 512),
        ("stalls", 704),
        ("longest_stall_ns", 712),
    ]

    @staticmethod
    def type_name():
        return "inekf.Health.v4"


class StateVector(ctypes.Structure):
    _fields_ = [
        ("model", ctypes.c_uint32),
        ("dimension", ctypes.c_uint32),
        ("stamp_ns", ctypes.c_uint64),
        ("q_wb", ctypes.c_double * 4),
        ("v_w_mps", ctypes.c_double * 3),
        ("p_w_m", ctypes.c_double * 3),
        ("gyro_bias_rps", ctypes.c_double * 3),
        ("accel_bias_mps2", ctypes.c_double * 3),
        ("covariance", ctypes.c_double * 120),
        ("parameter_count", ctypes.c_uint32),
        ("mode_count", ctypes.c_uint32),
        ("parameters", ctypes.c_double * 6),
        ("parameter_covariance", ctypes.c_double * 57),
        ("mode_weights", ctypes.c_double * 9),
    ]
    SIZE, ALIGN = 1688, 8
    OFFSETS = [
        ("model", 0),
        ("dimension", 4),
        ("stamp_ns", 8),
        ("q_wb", 16),
        ("v_w_mps", 48),
        ("p_w_m", 72),
        ("gyro_bias_rps", 96),
        ("accel_bias_mps2", 120),
        ("covariance", 144),
        ("parameter_count", 1104),
        ("mode_count", 1108),
        ("parameters", 1112),
        ("parameter_covariance", 1160),
        ("mode_weights", 1616),
    ]

    @staticmethod
    def type_name():
        return "inekf.StateVector.v2"


class ProcessNoise(ctypes.Structure):
    _fields_ = [
        ("form", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("rotation", ctypes.c_double),
        ("translation", ctypes.c_double),
        ("lateral", ctypes.c_double),
        ("gyro_bias_walk", ctypes.c_double),
        ("accel_bias_walk", ctypes.c_double),
        ("rotation_per_sqrt_m", ctypes.c_double),
        ("rotation_per_sqrt_rad", ctypes.c_double),
        ("translation_per_sqrt_m", ctypes.c_double),
    ]
    SIZE, ALIGN = 72, 8
    OFFSETS = [
        ("form", 0),
        ("reserved", 4),
        ("rotation", 8),
        ("translation", 16),
        ("lateral", 24),
        ("gyro_bias_walk", 32),
        ("accel_bias_walk", 40),
        ("rotation_per_sqrt_m", 48),
        ("rotation_per_sqrt_rad", 56),
        ("translation_per_sqrt_m", 64),
    ]

    @staticmethod
    def type_name():
        return "inekf.ProcessNoise.v1"


class ControlRequest(ctypes.Structure):
    _fields_ = [
        ("kind", ctypes.c_uint32),
        ("argument", ctypes.c_uint32),
        ("request_id", ctypes.c_uint64),
        ("state", StateVector),
        ("noise", ProcessNoise),
        ("input", ctypes.c_uint8 * 136),
    ]
    SIZE, ALIGN = 1912, 8
    OFFSETS = [
        ("kind", 0),
        ("argument", 4),
        ("request_id", 8),
        ("state", 16),
        ("noise", 1704),
        ("input", 1776),
    ]

    @staticmethod
    def type_name():
        return "inekf.ControlRequest.v3"


class ControlResponse(ctypes.Structure):
    _fields_ = [
        ("request_id", ctypes.c_uint64),
        ("status", ctypes.c_uint32),
        ("state_code", ctypes.c_uint32),
        ("waiting_for", ctypes.c_uint32),
        ("reason_len", ctypes.c_uint32),
        ("reason", ctypes.c_uint8 * 256),
        ("counters", Counters),
        ("received", ctypes.c_uint64 * 6),
        ("rejected_by_reason", ctypes.c_uint64 * 16),
        ("smoothed", ctypes.c_uint64),
        ("config_len", ctypes.c_uint64),
        ("state", StateVector),
    ]
    SIZE, ALIGN = 2208, 8
    OFFSETS = [
        ("request_id", 0),
        ("status", 8),
        ("state_code", 12),
        ("waiting_for", 16),
        ("reason_len", 20),
        ("reason", 24),
        ("counters", 280),
        ("received", 328),
        ("rejected_by_reason", 376),
        ("smoothed", 504),
        ("config_len", 512),
        ("state", 520),
    ]

    @staticmethod
    def type_name():
        return "inekf.ControlResponse.v5"


class JournalEntry(ctypes.Structure):
    _fields_ = [
        ("index", ctypes.c_uint64),
        ("estimates", ctypes.c_uint64),
        ("kind", ctypes.c_uint32),
        ("size", ctypes.c_uint32),
        ("payload", ctypes.c_uint8 * 1912),
    ]
    SIZE, ALIGN = 1936, 8
    OFFSETS = [
        ("index", 0),
        ("estimates", 8),
        ("kind", 16),
        ("size", 20),
        ("payload", 24),
    ]

    @staticmethod
    def type_name():
        return "inekf.JournalEntry.v2"


MESSAGES = [
    Header,
    ImuSample,
    Odometry2d,
    Odometry3d,
    PositionFix,
    VelocityFix,
    HeadingFix,
    Counters,
    EstimateHead,
    EstimateSe23,
    EstimateSe3,
    EstimateSe2,
    SmoothedState,
    Health,
    StateVector,
    ProcessNoise,
    ControlRequest,
    ControlResponse,
    JournalEntry,
]


def service_name(instance, topic):
    """Name of a service: topics are imu, odometry2d, odometry3d, position, velocity, heading,
    estimate, latest, smoothed, health, control and wake."""
    return f"inekf/{instance}/{topic}"


def open_node():
    """A node of the package iceoryx2 where the daemon looks: as INEKF_IPC_ROOT and INEKF_IPC_PREFIX say."""
    import iceoryx2

    config = iceoryx2.config.default()
    if "INEKF_IPC_ROOT" in os.environ:
        config.global_cfg.root_path = iceoryx2.Path.new(os.environ["INEKF_IPC_ROOT"])
    if "INEKF_IPC_PREFIX" in os.environ:
        config.global_cfg.prefix = iceoryx2.FileName.new(os.environ["INEKF_IPC_PREFIX"])
    return iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)


for _message in MESSAGES:
    _fields = [(name, getattr(_message, name).offset) for name, _ in _message._fields_]
    assert ctypes.sizeof(_message) == _message.SIZE, _message
    assert ctypes.alignment(_message) == _message.ALIGN, _message
    assert _fields == _message.OFFSETS, _message
    # Without a hole: a field of another size would leave one.
    _sizes = [ctypes.sizeof(held) for _, held in _message._fields_]
    assert sum(_sizes) == _message.SIZE, _message
