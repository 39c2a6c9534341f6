"""Feeds a running daemon with an IMU at rest and fixes at the origin: 200 Hz for so many seconds.

python feeder.py [INSTANCE [SECONDS]]
"""

import sys
import time

import iceoryx2 as iox2
import inekf_messages as inekf

instance = sys.argv[1] if len(sys.argv) > 1 else "default"
seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 5.0

node = inekf.open_node()


def service(topic):
    name = iox2.ServiceName.new(inekf.service_name(instance, topic))
    return node.service_builder(name)


def publisher(topic, message):
    builder = service(topic).publish_subscribe(message).open().publisher_builder()
    # A sender never waits for a reader.
    return builder.backpressure_strategy(iox2.BackpressureStrategy.DiscardData).create()


imu = publisher("imu", inekf.ImuSample)
position = publisher("position", inekf.PositionFix)
wake = service("wake").event().open().notifier_builder().create()

started_ns = time.monotonic_ns()
number = {imu: 0, position: 0}
heard = 0


def send(port, message, stamp_ns):
    """Stamps, numbers and sends; the daemon counts losses by the gaps in `seq`."""
    message.header = inekf.Header(stamp_ns, number[port], time.monotonic_ns(), started_ns)
    number[port] += 1
    receivers = port.send_copy(message)
    wake.notify()
    return receivers


for step in range(1, int(200 * seconds) + 1):
    stamp_ns = started_ns + step * 5_000_000
    time.sleep(max(0.0, (stamp_ns - time.monotonic_ns()) * 1e-9))
    if step % 40 == 0:
        # Row by row; a standard deviation of half a metre on each axis.
        covariance = (0.25, 0, 0, 0, 0.25, 0, 0, 0, 0.25)
        fix = inekf.PositionFix(source=0, dimension=3, covariance_w_m2=covariance)
        send(position, fix, stamp_ns)
    sample = inekf.ImuSample(gyro_rps=(0, 0, 0), accel_mps2=(0, 0, 9.80665))
    heard += send(imu, sample, stamp_ns) > 0

print(f"sent {number[imu]} samples, {heard} of them heard by a daemon")
