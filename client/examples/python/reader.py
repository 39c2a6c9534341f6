"""Prints estimates of a running daemon of the model `imu`: pip install iceoryx2==0.10.*

python reader.py [INSTANCE [COUNT]]
"""

import sys
import time

import iceoryx2 as iox2
import inekf_messages as inekf

instance = sys.argv[1] if len(sys.argv) > 1 else "default"
left = int(sys.argv[2]) if len(sys.argv) > 2 else 10

# `open`, never `open_or_create`: the daemon makes its services, with the limits that it needs.
node = inekf.open_node()
name = iox2.ServiceName.new(inekf.service_name(instance, "estimate"))
service = node.service_builder(name).publish_subscribe(inekf.EstimateSe23).open()
subscriber = service.subscriber_builder().buffer_size(1024).create()

while left > 0:
    sample = subscriber.receive()
    if sample is None:
        time.sleep(0.001)
        continue
    estimate = sample.payload().contents  # in shared memory: nothing is copied
    x, y, z = estimate.p_w_m
    print(f"{estimate.head.stamp_ns} x {x:.3f} y {y:.3f} z {z:.3f} m", flush=True)
    left -= 1
