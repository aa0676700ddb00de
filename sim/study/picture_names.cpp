#include "sim/study/picture_names.h"

namespace abbe::sim::study {
namespace {

constexpr std::size_t most_bytes = 80;

bool is_safe(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
         c == '.';
}

std::string lower_case(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = char(c - 'A' + 'a');
  return text;
}

}  // namespace

std::string file_part(const std::string& text) {
  std::string part;
  for (const char c : text) {
    if (is_safe(c) && !(part.empty() && c == '.'))
      part += c;
    else if (!part.empty() && part.back() != '-')
      part += '-';
    if (part.size() == most_bytes) break;
  }
  while (!part.empty() && (part.back() == '-' || part.back() == '.')) part.pop_back();
  return part.empty() ? "unnamed" : part;
}

std::string PictureNames::unused(const std::vector<std::string>& parts) {
  std::string name;
  for (const std::string& part : parts) name += (name.empty() ? "" : "-") + file_part(part);
  std::string free = name;
  for (int number = 2; !taken_.insert(lower_case(free)).second; ++number)
    free = name + "-" + std::to_string(number);
  return free;
}

}  // namespace abbe::sim::study
