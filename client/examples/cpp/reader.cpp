// Prints estimates of a running daemon of the model `imu`, on iceoryx2's public C++ bindings (0.10).
//
//     reader [INSTANCE [COUNT]]
//
// The bindings 0.10 are in no package registry: they are built from iceoryx2's sources, as its documentation says. The test
// that runs this skips, and says so, where ICEORYX2_CXX does not name the folder that they are installed in. The library
// inekf-c (client/c) does the same from C and C++, and is always run by the tests.
//
// Units SI; world east-north-up. The payload is read where it lies in shared memory: nothing is copied.

#include <chrono>
#include <cstdlib>
#include <iostream>
#include <string>
#include <thread>

#include "inekf_messages.h"
#include "iox2/iceoryx2.hpp"

namespace {

/// iceoryx2's configuration where the daemon looks: as INEKF_IPC_ROOT and INEKF_IPC_PREFIX say.
auto config_from_env() -> iox2::Config {
    iox2::Config config;
    if (const char* root = std::getenv("INEKF_IPC_ROOT")) {
        config.global().set_root_path(iox2::bb::Path::create(root).value());
    }
    if (const char* prefix = std::getenv("INEKF_IPC_PREFIX")) {
        config.global().set_prefix(iox2::bb::FileName::create(prefix).value());
    }
    return config;
}

} // namespace

auto main(int argc, char** argv) -> int {
    using namespace iox2;
    const std::string instance = argc > 1 ? argv[1] : "default";
    int left = argc > 2 ? std::atoi(argv[2]) : 10;

    auto config = config_from_env();
    auto node = NodeBuilder().config(config).create<ServiceType::Ipc>().value();
    const std::string name = "inekf/" + instance + "/estimate";

    // `open`, never `open_or_create`: the daemon makes its services, with the limits that it needs.
    auto service = node.service_builder(ServiceName::create(name.c_str()).value())
                       .publish_subscribe<InekfEstimateSe23>()
                       .open();
    if (!service.has_value()) {
        std::cerr << "no daemon of instance " << instance << " runs, or its messages are of another version\n";
        return 1;
    }
    auto subscriber = service.value().subscriber_builder().buffer_size(1024).create().value();

    while (left > 0) {
        auto sample = subscriber.receive().value();
        if (!sample.has_value()) {
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            continue;
        }
        const InekfEstimateSe23& estimate = sample->payload();
        std::cout << estimate.head.stamp_ns << " x " << estimate.p_w_m[0] << " y " << estimate.p_w_m[1] << " z "
                  << estimate.p_w_m[2] << " m\n";
        --left;
    }
    return 0;
}
