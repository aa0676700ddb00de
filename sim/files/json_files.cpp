#include "sim/files/json_files.h"

#include <stdexcept>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "kinematics/bad_input.h"
#include "kinematics/text.h"

namespace abbe::sim {

using nlohmann::ordered_json;

ordered_json number(const std::optional<double>& value, double unit) {
  return value ? ordered_json(*value / unit) : ordered_json();
}

ordered_json numbers(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

void read_saved_json(
    const std::filesystem::path& file, const std::string& expected,
    const std::function<void(const nlohmann::ordered_json& json, const std::string& text)>& parse) {
  const std::string text = read_text(file, max_saved_bytes);
  // nlohmann's parser recurses: deep nesting would overflow the stack.
  if (json_depth(text) > max_nesting)
    throw BadInput(file.string(), 0, 0, expected,
                   fmt::format("more than {} nested brackets", max_nesting));
  const ordered_json json = ordered_json::parse(text, nullptr, false);
  if (json.is_discarded()) throw BadInput(file.string(), 0, 0, expected, "text that is not JSON");
  try {
    parse(json, text);
  } catch (const ordered_json::exception& error) {
    throw BadInput(file.string(), 0, 0, expected, error.what());
  } catch (const std::invalid_argument& error) {
    throw BadInput(file.string(), 0, 0, expected, error.what());
  }
}

std::vector<std::filesystem::path> files_below(const std::filesystem::path& folder) {
  constexpr auto skip_denied = std::filesystem::directory_options::skip_permission_denied;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, skip_denied))
    if (entry.is_regular_file()) files.push_back(entry.path());
  return files;
}

}  // namespace abbe::sim
