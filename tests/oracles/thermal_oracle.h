#pragma once

#include <array>
#include <vector>

/// A second thermal network, by the matrix exponential of one augmented system (Van Loan 1978) in
/// quadruple precision, to hold the modes against. It shares no code with the modules.
namespace abbe::oracles {

/// Heat flows from a to b; -1 is the room, -2 the coolant.
struct HeatLink {
  int a = 0;
  int b = 0;
  double conductance = 0.0;  ///< W/K
};

struct HeatNetwork {
  std::vector<double> capacity;  ///< (n) J/K
  std::vector<HeatLink> links;
  int sensed = 0;    ///< node to which a sensor of time constant `lag` is fixed
  double lag = 1.0;  ///< s, > 0
};

/// What changes linearly over a stretch, at one of its ends.
struct HeatInput {
  std::vector<double> heat;                   ///< (n) W
  std::array<double, 2> outside{20.0, 20.0};  ///< deg C, room and coolant
};

struct HeatState {
  std::vector<double> T;  ///< (n) deg C
  double sensor = 0.0;    ///< deg C
};
struct HeatAnswer {
  HeatState state;
  std::vector<double> integral;  ///< (n) of T over the stretch, K s
};

/// State a time later, for inputs that go linearly from `start` to `end` in that time.
HeatAnswer heat_after(const HeatNetwork& network, const HeatState& from, const HeatInput& start,
                      const HeatInput& end, double seconds);

}  // namespace abbe::oracles
