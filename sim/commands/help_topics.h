#pragma once

#include <string>
#include <vector>

namespace abbe::sim {

/// What one has to know to read a figure of abbe.
struct HelpTopic {
  std::string name, summary, text;
};

const std::vector<HelpTopic>& help_topics();

}  // namespace abbe::sim
