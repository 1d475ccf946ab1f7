// Writes a fixed measurement to standard output, and the digest in an answer that comes on standard input.
#include <iostream>
#include <iterator>

#include "measurement.hpp"

int main() {
    const std::string answer{std::istreambuf_iterator<char>(std::cin), {}};
    Source source{"gps", "0123456789abcdef", digest_of(answer), 7};
    std::cout << measurement(source, {1.5, {}}, 1700000000250000001ull, 120, 1700000000251000000ull);
}
