#pragma once

#include "sim/dialects/read_program.h"
#include "tests/program/machines.h"
#include "tests/test.h"

/// What the tests of Siemens programs share.
namespace abbe::sim::dialects::siemens_test {

namespace machines = program::test;

/// The gantry with its table 30 mm below the tip at zero and off its middle.
inline machines::Chain low_gantry() {
  const machines::Chain gantry = machines::gantry();
  kinematics::Pose T_bw = kinematics::Pose::Identity();
  T_bw.translation() = Vector3d(7, -4, -30);
  return machines::Chain(gantry.joints(), T_bw, gantry.T_bt_home());
}

inline ReadOptions siemens_options(const machines::Chain& chain = machines::gantry()) {
  ReadOptions options;
  options.control = machines::options_for(chain);
  options.dialect = Dialect::Siemens;
  return options;
}

inline program::Path siemens_path(const std::string& text,
                                  const machines::Chain& chain = machines::gantry()) {
  return read_program(text, "part.mpf", siemens_options(chain)).path;
}

inline std::string siemens_refusal(const std::string& text,
                                   const ReadOptions& with = siemens_options()) {
  return thrown_text<BadInput>([&] { read_program(text, "part.mpf", with); }, "accepted");
}

}  // namespace abbe::sim::dialects::siemens_test
