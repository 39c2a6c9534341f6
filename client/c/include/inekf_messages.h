/* The messages of the estimation daemon. Written by `inekf-client layout --c`: do not edit.
 *
 * SI units and radians; world east-north-up, body forward-left-up; quaternions x, y, z, w, body to world.
 * Meaning, unit and frame of every field: the documentation of the Rust module inekf_shared::message. */
#ifndef INEKF_MESSAGES_H
#define INEKF_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define INEKF_CHECK(what) static_assert(what, "the layout is not the daemon's: " #what)
#define INEKF_TYPE_NAME(name) static constexpr const char* IOX2_TYPE_NAME = name;
#define INEKF_ALIGN(type) alignof(type)
#else
#define INEKF_CHECK(what) _Static_assert(what, "the layout is not the daemon's: " #what)
#define INEKF_TYPE_NAME(name)
#define INEKF_ALIGN(type) _Alignof(type)
#endif

#define INEKF_ESTIMATE_PROPAGATED 1u
#define INEKF_ESTIMATE_UPDATED 2u
#define INEKF_ESTIMATE_RESET 4u
#define INEKF_ESTIMATE_DEGRADED 8u
#define INEKF_ESTIMATE_REPLAYED 16u
#define INEKF_ESTIMATE_RESUMED 32u
#define INEKF_ESTIMATE_SMOOTHED 64u
#define INEKF_SMOOTHED_CUT 1u
#define INEKF_MODEL_IMU 1u
#define INEKF_MODEL_ODOMETRY_3D 2u
#define INEKF_MODEL_ODOMETRY_2D 3u
#define INEKF_NO_SOURCE 4294967295u
#define INEKF_ZERO_VELOCITY_SOURCE 4294967294u
#define INEKF_NO_MODE 4294967295u
#define INEKF_STATE_WAITING 1u
#define INEKF_STATE_ALIGNING 2u
#define INEKF_STATE_RUNNING 3u
#define INEKF_STATE_DEGRADED 4u
#define INEKF_STATE_STALE 5u
#define INEKF_STATE_PAUSED 6u
#define INEKF_WAITING_FOR_NOTHING 0u
#define INEKF_WAITING_FOR_IMU 1u
#define INEKF_WAITING_FOR_POSITION 2u
#define INEKF_WAITING_FOR_LEVEL 3u
#define INEKF_WAITING_FOR_REQUEST 4u
#define INEKF_CONTROL_RESET 1u
#define INEKF_CONTROL_SET_STATE 2u
#define INEKF_CONTROL_SNAPSHOT 3u
#define INEKF_CONTROL_BARRIER 4u
#define INEKF_CONTROL_SMOOTHED 5u
#define INEKF_CONTROL_PAUSE 6u
#define INEKF_CONTROL_RESUME 7u
#define INEKF_CONTROL_RELOAD_NOISE 8u
#define INEKF_CONTROL_CONFIG 9u
#define INEKF_CONTROL_TAKE 10u
#define INEKF_CONTROL_OK 0u
#define INEKF_CONTROL_REFUSED 1u

#define INEKF_HEADER_TYPE "inekf.Header.v1"
typedef struct InekfHeader {
    INEKF_TYPE_NAME(INEKF_HEADER_TYPE)
    uint64_t stamp_ns;
    uint64_t seq;
    uint64_t sent_ns;
    uint64_t epoch;
} InekfHeader;
INEKF_CHECK(sizeof(InekfHeader) == 32);
INEKF_CHECK(INEKF_ALIGN(InekfHeader) == 8);
INEKF_CHECK(offsetof(InekfHeader, stamp_ns) == 0);
INEKF_CHECK(offsetof(InekfHeader, seq) == 8);
INEKF_CHECK(offsetof(InekfHeader, sent_ns) == 16);
INEKF_CHECK(offsetof(InekfHeader, epoch) == 24);

#define INEKF_IMU_SAMPLE_TYPE "inekf.ImuSample.v1"
typedef struct InekfImuSample {
    INEKF_TYPE_NAME(INEKF_IMU_SAMPLE_TYPE)
    InekfHeader header;
    double gyro_rps[3];
    double accel_mps2[3];
} InekfImuSample;
INEKF_CHECK(sizeof(InekfImuSample) == 80);
INEKF_CHECK(INEKF_ALIGN(InekfImuSample) == 8);
INEKF_CHECK(offsetof(InekfImuSample, header) == 0);
INEKF_CHECK(offsetof(InekfImuSample, gyro_rps) == 32);
INEKF_CHECK(offsetof(InekfImuSample, accel_mps2) == 56);

#define INEKF_ODOMETRY2D_TYPE "inekf.Odometry2d.v1"
typedef struct InekfOdometry2d {
    INEKF_TYPE_NAME(INEKF_ODOMETRY2D_TYPE)
    InekfHeader header;
    double dtheta_rad;
    double translation_m[2];
} InekfOdometry2d;
INEKF_CHECK(sizeof(InekfOdometry2d) == 56);
INEKF_CHECK(INEKF_ALIGN(InekfOdometry2d) == 8);
INEKF_CHECK(offsetof(InekfOdometry2d, header) == 0);
INEKF_CHECK(offsetof(InekfOdometry2d, dtheta_rad) == 32);
INEKF_CHECK(offsetof(InekfOdometry2d, translation_m) == 40);

#define INEKF_ODOMETRY3D_TYPE "inekf.Odometry3d.v1"
typedef struct InekfOdometry3d {
    INEKF_TYPE_NAME(INEKF_ODOMETRY3D_TYPE)
    InekfHeader header;
    double rotation_rad[3];
    double translation_m[3];
} InekfOdometry3d;
INEKF_CHECK(sizeof(InekfOdometry3d) == 80);
INEKF_CHECK(INEKF_ALIGN(InekfOdometry3d) == 8);
INEKF_CHECK(offsetof(InekfOdometry3d, header) == 0);
INEKF_CHECK(offsetof(InekfOdometry3d, rotation_rad) == 32);
INEKF_CHECK(offsetof(InekfOdometry3d, translation_m) == 56);

#define INEKF_POSITION_FIX_TYPE "inekf.PositionFix.v1"
typedef struct InekfPositionFix {
    INEKF_TYPE_NAME(INEKF_POSITION_FIX_TYPE)
    InekfHeader header;
    uint32_t source;
    uint32_t dimension;
    double position_w_m[3];
    double covariance_w_m2[9];
} InekfPositionFix;
INEKF_CHECK(sizeof(InekfPositionFix) == 136);
INEKF_CHECK(INEKF_ALIGN(InekfPositionFix) == 8);
INEKF_CHECK(offsetof(InekfPositionFix, header) == 0);
INEKF_CHECK(offsetof(InekfPositionFix, source) == 32);
INEKF_CHECK(offsetof(InekfPositionFix, dimension) == 36);
INEKF_CHECK(offsetof(InekfPositionFix, position_w_m) == 40);
INEKF_CHECK(offsetof(InekfPositionFix, covariance_w_m2) == 64);

#define INEKF_VELOCITY_FIX_TYPE "inekf.VelocityFix.v1"
typedef struct InekfVelocityFix {
    INEKF_TYPE_NAME(INEKF_VELOCITY_FIX_TYPE)
    InekfHeader header;
    uint32_t source;
    uint32_t flags;
    double velocity_w_mps[3];
    double covariance_w[9];
} InekfVelocityFix;
INEKF_CHECK(sizeof(InekfVelocityFix) == 136);
INEKF_CHECK(INEKF_ALIGN(InekfVelocityFix) == 8);
INEKF_CHECK(offsetof(InekfVelocityFix, header) == 0);
INEKF_CHECK(offsetof(InekfVelocityFix, source) == 32);
INEKF_CHECK(offsetof(InekfVelocityFix, flags) == 36);
INEKF_CHECK(offsetof(InekfVelocityFix, velocity_w_mps) == 40);
INEKF_CHECK(offsetof(InekfVelocityFix, covariance_w) == 64);

#define INEKF_HEADING_FIX_TYPE "inekf.HeadingFix.v1"
typedef struct InekfHeadingFix {
    INEKF_TYPE_NAME(INEKF_HEADING_FIX_TYPE)
    InekfHeader header;
    uint32_t source;
    uint32_t flags;
    double heading_rad;
    double sigma_rad;
} InekfHeadingFix;
INEKF_CHECK(sizeof(InekfHeadingFix) == 56);
INEKF_CHECK(INEKF_ALIGN(InekfHeadingFix) == 8);
INEKF_CHECK(offsetof(InekfHeadingFix, header) == 0);
INEKF_CHECK(offsetof(InekfHeadingFix, source) == 32);
INEKF_CHECK(offsetof(InekfHeadingFix, flags) == 36);
INEKF_CHECK(offsetof(InekfHeadingFix, heading_rad) == 40);
INEKF_CHECK(offsetof(InekfHeadingFix, sigma_rad) == 48);

#define INEKF_COUNTERS_TYPE "inekf.Counters.v2"
typedef struct InekfCounters {
    INEKF_TYPE_NAME(INEKF_COUNTERS_TYPE)
    uint64_t accepted;
    uint64_t gated;
    uint64_t late;
    uint64_t lost;
    uint64_t rejected;
    uint64_t unpaired;
} InekfCounters;
INEKF_CHECK(sizeof(InekfCounters) == 48);
INEKF_CHECK(INEKF_ALIGN(InekfCounters) == 8);
INEKF_CHECK(offsetof(InekfCounters, accepted) == 0);
INEKF_CHECK(offsetof(InekfCounters, gated) == 8);
INEKF_CHECK(offsetof(InekfCounters, late) == 16);
INEKF_CHECK(offsetof(InekfCounters, lost) == 24);
INEKF_CHECK(offsetof(InekfCounters, rejected) == 32);
INEKF_CHECK(offsetof(InekfCounters, unpaired) == 40);

#define INEKF_ESTIMATE_HEAD_TYPE "inekf.EstimateHead.v2"
typedef struct InekfEstimateHead {
    INEKF_TYPE_NAME(INEKF_ESTIMATE_HEAD_TYPE)
    uint64_t stamp_ns;
    uint64_t seq;
    uint64_t sent_ns;
    uint64_t received_ns;
    uint64_t published_ns;
    uint64_t estimate_seq;
    uint64_t reset_count;
    double reset_jump_m;
    uint32_t flags;
    uint32_t state;
    uint32_t source;
    uint32_t dimension;
    uint32_t active_mismatches;
    uint32_t mode;
    InekfCounters counters;
    double nis[8];
} InekfEstimateHead;
INEKF_CHECK(sizeof(InekfEstimateHead) == 200);
INEKF_CHECK(INEKF_ALIGN(InekfEstimateHead) == 8);
INEKF_CHECK(offsetof(InekfEstimateHead, stamp_ns) == 0);
INEKF_CHECK(offsetof(InekfEstimateHead, seq) == 8);
INEKF_CHECK(offsetof(InekfEstimateHead, sent_ns) == 16);
INEKF_CHECK(offsetof(InekfEstimateHead, received_ns) == 24);
INEKF_CHECK(offsetof(InekfEstimateHead, published_ns) == 32);
INEKF_CHECK(offsetof(InekfEstimateHead, estimate_seq) == 40);
INEKF_CHECK(offsetof(InekfEstimateHead, reset_count) == 48);
INEKF_CHECK(offsetof(InekfEstimateHead, reset_jump_m) == 56);
INEKF_CHECK(offsetof(InekfEstimateHead, flags) == 64);
INEKF_CHECK(offsetof(InekfEstimateHead, state) == 68);
INEKF_CHECK(offsetof(InekfEstimateHead, source) == 72);
INEKF_CHECK(offsetof(InekfEstimateHead, dimension) == 76);
INEKF_CHECK(offsetof(InekfEstimateHead, active_mismatches) == 80);
INEKF_CHECK(offsetof(InekfEstimateHead, mode) == 84);
INEKF_CHECK(offsetof(InekfEstimateHead, counters) == 88);
INEKF_CHECK(offsetof(InekfEstimateHead, nis) == 136);

#define INEKF_ESTIMATE_SE23_TYPE "inekf.EstimateSe23.v2"
typedef struct InekfEstimateSe23 {
    INEKF_TYPE_NAME(INEKF_ESTIMATE_SE23_TYPE)
    InekfEstimateHead head;
    double q_wb[4];
    double v_w_mps[3];
    double p_w_m[3];
    double gyro_bias_rps[3];
    double accel_bias_mps2[3];
    double covariance[120];
} InekfEstimateSe23;
INEKF_CHECK(sizeof(InekfEstimateSe23) == 1288);
INEKF_CHECK(INEKF_ALIGN(InekfEstimateSe23) == 8);
INEKF_CHECK(offsetof(InekfEstimateSe23, head) == 0);
INEKF_CHECK(offsetof(InekfEstimateSe23, q_wb) == 200);
INEKF_CHECK(offsetof(InekfEstimateSe23, v_w_mps) == 232);
INEKF_CHECK(offsetof(InekfEstimateSe23, p_w_m) == 256);
INEKF_CHECK(offsetof(InekfEstimateSe23, gyro_bias_rps) == 280);
INEKF_CHECK(offsetof(InekfEstimateSe23, accel_bias_mps2) == 304);
INEKF_CHECK(offsetof(InekfEstimateSe23, covariance) == 328);

#define INEKF_ESTIMATE_SE3_TYPE "inekf.EstimateSe3.v2"
typedef struct InekfEstimateSe3 {
    INEKF_TYPE_NAME(INEKF_ESTIMATE_SE3_TYPE)
    InekfEstimateHead head;
    double q_wb[4];
    double p_w_m[3];
    double covariance[21];
    double mismatch[6];
    double mismatch_sigma[6];
} InekfEstimateSe3;
INEKF_CHECK(sizeof(InekfEstimateSe3) == 520);
INEKF_CHECK(INEKF_ALIGN(InekfEstimateSe3) == 8);
INEKF_CHECK(offsetof(InekfEstimateSe3, head) == 0);
INEKF_CHECK(offsetof(InekfEstimateSe3, q_wb) == 200);
INEKF_CHECK(offsetof(InekfEstimateSe3, p_w_m) == 232);
INEKF_CHECK(offsetof(InekfEstimateSe3, covariance) == 256);
INEKF_CHECK(offsetof(InekfEstimateSe3, mismatch) == 424);
INEKF_CHECK(offsetof(InekfEstimateSe3, mismatch_sigma) == 472);

#define INEKF_ESTIMATE_SE2_TYPE "inekf.EstimateSe2.v2"
typedef struct InekfEstimateSe2 {
    INEKF_TYPE_NAME(INEKF_ESTIMATE_SE2_TYPE)
    InekfEstimateHead head;
    double theta_rad;
    double p_w_m[2];
    double covariance[6];
    double mismatch[6];
    double mismatch_sigma[6];
} InekfEstimateSe2;
INEKF_CHECK(sizeof(InekfEstimateSe2) == 368);
INEKF_CHECK(INEKF_ALIGN(InekfEstimateSe2) == 8);
INEKF_CHECK(offsetof(InekfEstimateSe2, head) == 0);
INEKF_CHECK(offsetof(InekfEstimateSe2, theta_rad) == 200);
INEKF_CHECK(offsetof(InekfEstimateSe2, p_w_m) == 208);
INEKF_CHECK(offsetof(InekfEstimateSe2, covariance) == 224);
INEKF_CHECK(offsetof(InekfEstimateSe2, mismatch) == 272);
INEKF_CHECK(offsetof(InekfEstimateSe2, mismatch_sigma) == 320);

#define INEKF_SMOOTHED_STATE_TYPE "inekf.SmoothedState.v2"
typedef struct InekfSmoothedState {
    INEKF_TYPE_NAME(INEKF_SMOOTHED_STATE_TYPE)
    uint64_t stamp_ns;
    uint64_t request_id;
    uint64_t index;
    uint64_t count;
    uint32_t dimension;
    uint32_t flags;
    double q_wb[4];
    double v_w_mps[3];
    double p_w_m[3];
    double gyro_bias_rps[3];
    double accel_bias_mps2[3];
    double covariance[120];
} InekfSmoothedState;
INEKF_CHECK(sizeof(InekfSmoothedState) == 1128);
INEKF_CHECK(INEKF_ALIGN(InekfSmoothedState) == 8);
INEKF_CHECK(offsetof(InekfSmoothedState, stamp_ns) == 0);
INEKF_CHECK(offsetof(InekfSmoothedState, request_id) == 8);
INEKF_CHECK(offsetof(InekfSmoothedState, index) == 16);
INEKF_CHECK(offsetof(InekfSmoothedState, count) == 24);
INEKF_CHECK(offsetof(InekfSmoothedState, dimension) == 32);
INEKF_CHECK(offsetof(InekfSmoothedState, flags) == 36);
INEKF_CHECK(offsetof(InekfSmoothedState, q_wb) == 40);
INEKF_CHECK(offsetof(InekfSmoothedState, v_w_mps) == 72);
INEKF_CHECK(offsetof(InekfSmoothedState, p_w_m) == 96);
INEKF_CHECK(offsetof(InekfSmoothedState, gyro_bias_rps) == 120);
INEKF_CHECK(offsetof(InekfSmoothedState, accel_bias_mps2) == 144);
INEKF_CHECK(offsetof(InekfSmoothedState, covariance) == 168);

#define INEKF_HEALTH_TYPE "inekf.Health.v4"
typedef struct InekfHealth {
    INEKF_TYPE_NAME(INEKF_HEALTH_TYPE)
    uint64_t stamp_ns;
    uint64_t uptime_ns;
    uint64_t instance_pid;
    uint32_t state;
    uint32_t waiting_for;
    uint32_t model;
    uint32_t flags;
    uint64_t last_imu_stamp_ns;
    double imu_rate_hz;
    InekfCounters counters;
    uint64_t rejected_by_reason[16];
    uint64_t received[6];
    uint64_t checkpoints;
    uint64_t checkpoint_failures;
    uint64_t journal_failures;
    uint64_t last_fix_stamp_ns;
    uint64_t last_delivery_ns;
    uint64_t fused_stamp_ns[24];
    uint64_t delivered_ns[24];
    uint64_t stalls;
    uint64_t longest_stall_ns;
} InekfHealth;
INEKF_CHECK(sizeof(InekfHealth) == 720);
INEKF_CHECK(INEKF_ALIGN(InekfHealth) == 8);
INEKF_CHECK(offsetof(InekfHealth, stamp_ns) == 0);
INEKF_CHECK(offsetof(InekfHealth, uptime_ns) == 8);
INEKF_CHECK(offsetof(InekfHealth, instance_pid) == 16);
INEKF_CHECK(offsetof(InekfHealth, state) == 24);
INEKF_CHECK(offsetof(InekfHealth, waiting_for) == 28);
INEKF_CHECK(offsetof(InekfHealth, model) == 32);
INEKF_CHECK(offsetof(InekfHealth, flags) == 36);
INEKF_CHECK(offsetof(InekfHealth, last_imu_stamp_ns) == 40);
INEKF_CHECK(offsetof(InekfHealth, imu_rate_hz) == 48);
INEKF_CHECK(offsetof(InekfHealth, counters) == 56);
INEKF_CHECK(offsetof(InekfHealth, rejected_by_reason) == 104);
INEKF_CHECK(offsetof(InekfHealth, received) == 232);
INEKF_CHECK(offsetof(InekfHealth, checkpoints) == 280);
INEKF_CHECK(offsetof(InekfHealth, checkpoint_failures) == 288);
INEKF_CHECK(offsetof(InekfHealth, journal_failures) == 296);
INEKF_CHECK(offsetof(InekfHealth, last_fix_stamp_ns) == 304);
INEKF_CHECK(offsetof(InekfHealth, last_delivery_ns) == 312);
INEKF_CHECK(offsetof(InekfHealth, fused_stamp_ns) == 320);
INEKF_CHECK(offsetof(InekfHealth, delivered_ns) == 512);
INEKF_CHECK(offsetof(InekfHealth, stalls) == 704);
INEKF_CHECK(offsetof(InekfHealth, longest_stall_ns) == 712);

#define INEKF_STATE_VECTOR_TYPE "inekf.StateVector.v2"
typedef struct InekfStateVector {
    INEKF_TYPE_NAME(INEKF_STATE_VECTOR_TYPE)
    uint32_t model;
    uint32_t dimension;
    uint64_t stamp_ns;
    double q_wb[4];
    double v_w_mps[3];
    double p_w_m[3];
    double gyro_bias_rps[3];
    double accel_bias_mps2[3];
    double covariance[120];
    uint32_t parameter_count;
    uint32_t mode_count;
    double parameters[6];
    double parameter_covariance[57];
    double mode_weights[9];
} InekfStateVector;
INEKF_CHECK(sizeof(InekfStateVector) == 1688);
INEKF_CHECK(INEKF_ALIGN(InekfStateVector) == 8);
INEKF_CHECK(offsetof(InekfStateVector, model) == 0);
INEKF_CHECK(offsetof(InekfStateVector, dimension) == 4);
INEKF_CHECK(offsetof(InekfStateVector, stamp_ns) == 8);
INEKF_CHECK(offsetof(InekfStateVector, q_wb) == 16);
INEKF_CHECK(offsetof(InekfStateVector, v_w_mps) == 48);
INEKF_CHECK(offsetof(InekfStateVector, p_w_m) == 72);
INEKF_CHECK(offsetof(InekfStateVector, gyro_bias_rps) == 96);
INEKF_CHECK(offsetof(InekfStateVector, accel_bias_mps2) == 120);
INEKF_CHECK(offsetof(InekfStateVector, covariance) == 144);
INEKF_CHECK(offsetof(InekfStateVector, parameter_count) == 1104);
INEKF_CHECK(offsetof(InekfStateVector, mode_count) == 1108);
INEKF_CHECK(offsetof(InekfStateVector, parameters) == 1112);
INEKF_CHECK(offsetof(InekfStateVector, parameter_covariance) == 1160);
INEKF_CHECK(offsetof(InekfStateVector, mode_weights) == 1616);

#define INEKF_PROCESS_NOISE_TYPE "inekf.ProcessNoise.v1"
typedef struct InekfProcessNoise {
    INEKF_TYPE_NAME(INEKF_PROCESS_NOISE_TYPE)
    uint32_t form;
    uint32_t reserved;
    double rotation;
    double translation;
    double lateral;
    double gyro_bias_walk;
    double accel_bias_walk;
    double rotation_per_sqrt_m;
    double rotation_per_sqrt_rad;
    double translation_per_sqrt_m;
} InekfProcessNoise;
INEKF_CHECK(sizeof(InekfProcessNoise) == 72);
INEKF_CHECK(INEKF_ALIGN(InekfProcessNoise) == 8);
INEKF_CHECK(offsetof(InekfProcessNoise, form) == 0);
INEKF_CHECK(offsetof(InekfProcessNoise, reserved) == 4);
INEKF_CHECK(offsetof(InekfProcessNoise, rotation) == 8);
INEKF_CHECK(offsetof(InekfProcessNoise, translation) == 16);
INEKF_CHECK(offsetof(InekfProcessNoise, lateral) == 24);
INEKF_CHECK(offsetof(InekfProcessNoise, gyro_bias_walk) == 32);
INEKF_CHECK(offsetof(InekfProcessNoise, accel_bias_walk) == 40);
INEKF_CHECK(offsetof(InekfProcessNoise, rotation_per_sqrt_m) == 48);
INEKF_CHECK(offsetof(InekfProcessNoise, rotation_per_sqrt_rad) == 56);
INEKF_CHECK(offsetof(InekfProcessNoise, translation_per_sqrt_m) == 64);

#define INEKF_CONTROL_REQUEST_TYPE "inekf.ControlRequest.v3"
typedef struct InekfControlRequest {
    INEKF_TYPE_NAME(INEKF_CONTROL_REQUEST_TYPE)
    uint32_t kind;
    uint32_t argument;
    uint64_t request_id;
    InekfStateVector state;
    InekfProcessNoise noise;
    uint8_t input[136];
} InekfControlRequest;
INEKF_CHECK(sizeof(InekfControlRequest) == 1912);
INEKF_CHECK(INEKF_ALIGN(InekfControlRequest) == 8);
INEKF_CHECK(offsetof(InekfControlRequest, kind) == 0);
INEKF_CHECK(offsetof(InekfControlRequest, argument) == 4);
INEKF_CHECK(offsetof(InekfControlRequest, request_id) == 8);
INEKF_CHECK(offsetof(InekfControlRequest, state) == 16);
INEKF_CHECK(offsetof(InekfControlRequest, noise) == 1704);
INEKF_CHECK(offsetof(InekfControlRequest, input) == 1776);

#define INEKF_CONTROL_RESPONSE_TYPE "inekf.ControlResponse.v5"
typedef struct InekfControlResponse {
    INEKF_TYPE_NAME(INEKF_CONTROL_RESPONSE_TYPE)
    uint64_t request_id;
    uint32_t status;
    uint32_t state_code;
    uint32_t waiting_for;
    uint32_t reason_len;
    uint8_t reason[256];
    InekfCounters counters;
    uint64_t received[6];
    uint64_t rejected_by_reason[16];
    uint64_t smoothed;
    uint64_t config_len;
    InekfStateVector state;
} InekfControlResponse;
INEKF_CHECK(sizeof(InekfControlResponse) == 2208);
INEKF_CHECK(INEKF_ALIGN(InekfControlResponse) == 8);
INEKF_CHECK(offsetof(InekfControlResponse, request_id) == 0);
INEKF_CHECK(offsetof(InekfControlResponse, status) == 8);
INEKF_CHECK(offsetof(InekfControlResponse, state_code) == 12);
INEKF_CHECK(offsetof(InekfControlResponse, waiting_for) == 16);
INEKF_CHECK(offsetof(InekfControlResponse, reason_len) == 20);
INEKF_CHECK(offsetof(InekfControlResponse, reason) == 24);
INEKF_CHECK(offsetof(InekfControlResponse, counters) == 280);
INEKF_CHECK(offsetof(InekfControlResponse, received) == 328);
INEKF_CHECK(offsetof(InekfControlResponse, rejected_by_reason) == 376);
INEKF_CHECK(offsetof(InekfControlResponse, smoothed) == 504);
INEKF_CHECK(offsetof(InekfControlResponse, config_len) == 512);
INEKF_CHECK(offsetof(InekfControlResponse, state) == 520);

#define INEKF_JOURNAL_ENTRY_TYPE "inekf.JournalEntry.v2"
typedef struct InekfJournalEntry {
    INEKF_TYPE_NAME(INEKF_JOURNAL_ENTRY_TYPE)
    uint64_t index;
    uint64_t estimates;
    uint32_t kind;
    uint32_t size;
    uint8_t payload[1912];
} InekfJournalEntry;
INEKF_CHECK(sizeof(InekfJournalEntry) == 1936);
INEKF_CHECK(INEKF_ALIGN(InekfJournalEntry) == 8);
INEKF_CHECK(offsetof(InekfJournalEntry, index) == 0);
INEKF_CHECK(offsetof(InekfJournalEntry, estimates) == 8);
INEKF_CHECK(offsetof(InekfJournalEntry, kind) == 16);
INEKF_CHECK(offsetof(InekfJournalEntry, size) == 20);
INEKF_CHECK(offsetof(InekfJournalEntry, payload) == 24);

#endif
