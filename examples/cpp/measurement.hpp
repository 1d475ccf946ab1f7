// A measurement as docs/protocol.md specifies it, in MessagePack, without a library. C++17.
#pragma once
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

struct Pack {
    std::string bytes;

    void big_endian(uint64_t value, int size) {
        for (int i = size - 1; i >= 0; --i) bytes += static_cast<char>(value >> (8 * i));
    }
    void head(char marker, uint64_t value, int size) { bytes += marker; big_endian(value, size); }
    void map(uint16_t count) { head('\xde', count, 2); }
    void list(uint16_t count) { head('\xdc', count, 2); }
    void nil() { bytes += '\xc0'; }
    void whole(uint64_t value) { head('\xcf', value, 8); }
    void number(double value) {
        uint64_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        head('\xcb', bits, 8);
    }
    void text(const std::string& value) { head('\xda', value.size(), 2); bytes += value; }
};

struct Source {
    std::string name, boot;   // boot: 16 hexadecimal characters, drawn anew at each start
    std::string digest;       // of the mesh, from the answer to the model query
    uint64_t seq = 0;         // counts the messages of this key and boot from 0
};

// y measured at time_ns, nanoseconds since 1970, give or take error_ns; an output without a value was not measured.
inline std::string measurement(
    Source& source, const std::vector<std::optional<double>>& y, uint64_t time_ns, uint64_t error_ns, uint64_t now_ns
) {
    Pack pack;
    pack.map(11);
    pack.text("v"); pack.whole(1);
    pack.text("src"); pack.text("sensor/" + source.name);
    pack.text("boot"); pack.text(source.boot);
    pack.text("seq"); pack.whole(source.seq++);
    pack.text("step"); pack.whole(0);  // the mesh counts it from the time
    pack.text("sent_ns"); pack.whole(now_ns);
    pack.text("origin_ns"); pack.whole(now_ns);
    pack.text("model"); pack.text(source.digest);
    pack.text("time_ns"); pack.whole(time_ns);
    pack.text("time_error_ns"); pack.whole(error_ns);
    pack.text("y"); pack.list(y.size());
    for (const auto& value : y) value ? pack.number(*value) : pack.nil();
    return pack.bytes;
}

// The digest in the answer to the model query: the string of 16 characters under "model".
inline std::string digest_of(const std::string& answer) {
    const std::string key("\xa5model\xb0", 7);
    const auto at = answer.find(key);
    return at == std::string::npos ? "" : answer.substr(at + key.size(), 16);
}
