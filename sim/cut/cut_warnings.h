#pragma once

#include <string>
#include <vector>

#include "sim/cut/process.h"
#include "sim/scene/scene.h"

namespace abbe::sim {

/// Puts some behind others.
void add_warnings(std::vector<std::string> more, std::vector<std::string>& warnings);

/// What a scene describes and nothing in it uses, in words.
std::vector<std::string> idle_warnings(const Scene& scene);

/// What went wrong with the cut itself, in words.
std::vector<std::string> process_warnings(const Scene& scene, const Process& process);

}  // namespace abbe::sim
