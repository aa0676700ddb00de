#include "sim/files/matches.h"

#include <regex>

namespace abbe::sim {

bool matches(const std::string& text, const std::string& pattern) {
  return std::regex_match(text, std::regex(pattern));
}

}  // namespace abbe::sim
