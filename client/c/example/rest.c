/* Feeds a daemon with an IMU at rest and fixes, and reads what comes of it: rest [INSTANCE]
 *
 * cargo build --release -p inekf-c
 * cc -I client/c/include client/c/example/rest.c -L target/release -linekf_c -o rest
 */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <time.h>

#include "inekf.h"

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

int main(int argc, char** argv) {
    const char* instance = argc > 1 ? argv[1] : "default";
    InekfReader* reader = inekf_reader_open(instance);
    InekfFeeder* feeder = inekf_feeder_open(instance);
    if (!reader || !feeder) {
        fprintf(stderr, "rest: %s\n", inekf_last_error());
        return 1;
    }
    const double still[3] = {0, 0, 0}, up[3] = {0, 0, 9.80665};
    const double place[3] = {1, 2, 3}, sigma[3] = {0.5, 0.5, 0.5};
    const struct timespec period = {0, 5000000};
    double position[3] = {0, 0, 0};
    int heard = 0, estimates = 0;
    for (int step = 1; step <= 200; ++step) {
        nanosleep(&period, NULL);
        uint64_t stamp_ns = now_ns();
        if (step % 40 == 0) {
            inekf_feeder_position(feeder, stamp_ns, 0, place, sigma);
        }
        heard += inekf_feeder_imu(feeder, stamp_ns, still, up) > 0;
        const InekfEstimateSe23* estimate;
        while ((estimate = inekf_reader_next(reader, NULL))) {
            ++estimates;
            for (int i = 0; i < 3; ++i) position[i] = estimate->p_w_m[i];
        }
    }
    printf("%d samples heard, estimates %s; now at %.2f %.2f %.2f m\n", heard, estimates > 100 ? "came" : "lack",
           position[0], position[1], position[2]);
    inekf_feeder_close(feeder);
    inekf_reader_close(reader);
    return 0;
}
