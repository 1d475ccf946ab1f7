// A sensor of one output in C++: sensor ENDPOINT MESH NAME; each line of input is a number. See docs/your-own-sensors.md.
#include <chrono>
#include <cstdio>
#include <iostream>
#include <random>

#include "measurement.hpp"
#include "zenoh.hxx"

static uint64_t now_ns() {
    using namespace std::chrono;
    return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

int main(int argc, char** argv) {
    if (argc != 4) return std::cerr << "usage: sensor ENDPOINT MESH NAME\n", 2;
    const std::string mesh = std::string("lsu/v1/") + argv[2], name = argv[3];
#ifdef ZENOHCXX_ZENOHC
    auto config = zenoh::Config::create_default();
    config.insert_json5("connect/endpoints", "[\"" + std::string(argv[1]) + "\"]");
#else  // zenoh-pico
    auto config = zenoh::Config::create_default();
    config.insert(Z_CONFIG_MODE_KEY, "client");
    config.insert(Z_CONFIG_CONNECT_KEY, argv[1]);
#endif
    auto session = zenoh::Session::open(std::move(config));
    auto token = session.liveliness_declare_token(zenoh::KeyExpr(mesh + "/live/" + name));
    auto publisher = session.declare_publisher(zenoh::KeyExpr(mesh + "/measurement/" + name));
    std::random_device random;
    char boot[17];
    std::snprintf(boot, sizeof boot, "%08x%08x", random(), random());
    Source source{name, boot, "", 0};
    uint64_t asked = 0;
    for (std::string line; std::getline(std::cin, line);) {
        const uint64_t measured = now_ns();
        while (source.digest.empty() || now_ns() > asked + 1'000'000'000) {  // a mesh that began anew has another digest
            zenoh::Session::GetOptions options;
            options.timeout_ms = 1000;
            auto replies = session.get(zenoh::KeyExpr(mesh + "/model"), "", zenoh::channels::FifoChannel(16), std::move(options));
            for (auto one = replies.recv(); std::holds_alternative<zenoh::Reply>(one); one = replies.recv())
                if (const auto& reply = std::get<zenoh::Reply>(one); reply.is_ok())
                    source.digest = digest_of(reply.get_ok().get_payload().as_string());
            asked = now_ns();
        }
        publisher.put(measurement(source, {std::stod(line)}, measured, 0, now_ns()));
    }
}
