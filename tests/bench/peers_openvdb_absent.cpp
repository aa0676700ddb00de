#include "tests/bench/peers.h"

namespace abbe::bench {

std::optional<Deviations> openvdb_deviations(const PeerTask&, double) { return std::nullopt; }

}  // namespace abbe::bench
