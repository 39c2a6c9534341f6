/* C interface of the estimation daemon's client, for C11 and C++17.
 *
 * A program is a reader, a feeder, or both. Estimates are read where they lie in shared memory: nothing is copied.
 * SI units and radians; world east-north-up, body forward-left-up; the messages are in inekf_messages.h.
 *
 * A handle belongs to one thread at a time. What fails returns NULL or -1, and inekf_last_error() says why, for this
 * thread and until the next failure. No function waits. INEKF_IPC_ROOT and INEKF_IPC_PREFIX are heeded. */
#ifndef INEKF_H
#define INEKF_H

#include "inekf_messages.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Why the last call failed; never NULL. */
const char* inekf_last_error(void);

/* Reads every estimate of one daemon of the model `imu`, in order. */
typedef struct InekfReader InekfReader;

/* A reader of an instance; it gets what is published from now on. NULL: it failed. */
InekfReader* inekf_reader_open(const char* instance);

/* The next estimate, in shared memory: valid until the next call with this reader. NULL: none waits, or it failed;
 * *failed, if given, is then 0 or 1. */
const InekfEstimateSe23* inekf_reader_next(InekfReader* reader, int* failed);

/* Closes; NULL is allowed. */
void inekf_reader_close(InekfReader* reader);

/* Stamps, numbers and sends samples to one daemon, and wakes it. */
typedef struct InekfFeeder InekfFeeder;

/* A feeder of an instance, whether its daemon runs already or not. NULL: it failed. */
InekfFeeder* inekf_feeder_open(const char* instance);

/* Sends an IMU sample: rad/s and specific force in m/s^2, body axes, +9.81 on z at rest. Returns the number of daemons
 * that got it, -1: it failed. So do the others. */
int inekf_feeder_imu(InekfFeeder* feeder, uint64_t stamp_ns, const double gyro_rps[3], const double accel_mps2[3]);

/* Sends a position fix: m, world axes, one standard deviation by axis. */
int inekf_feeder_position(InekfFeeder* feeder, uint64_t stamp_ns, uint32_t source, const double position_w_m[3],
                          const double sigma_m[3]);

/* Sends a velocity fix: m/s, world axes, one standard deviation by axis. */
int inekf_feeder_velocity(InekfFeeder* feeder, uint64_t stamp_ns, uint32_t source, const double velocity_w_mps[3],
                          const double sigma_mps[3]);

/* Closes; NULL is allowed. */
void inekf_feeder_close(InekfFeeder* feeder);

#ifdef __cplusplus
}
#endif

#endif
