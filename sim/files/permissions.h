#pragma once

#include <string>

namespace abbe::sim {

/// What the user says of a run beside the scene.
struct Permissions {
  std::string command = {};  ///< as it was typed, for the marks of results
  bool force = false;        ///< --force: write into folders and over files that abbe did not make
  bool trust = false;        ///< --trust: run the programs that scenes and studies name
};

}  // namespace abbe::sim
