#include "sim/program/text.h"

#include <fmt/format.h>

#include <fstream>
#include <system_error>

#include "kinematics/bad_input.h"

namespace abbe::sim::program {

std::string read_text(const std::filesystem::path& file, std::size_t max_bytes) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(file, failure))
    throw BadInput(file.string(), 0, 0, "a file",
                   std::filesystem::exists(file, failure) ? "something else" : "none");
  const auto bytes = std::filesystem::file_size(file, failure);
  if (failure) throw BadInput(file.string(), 0, 0, "a readable file", failure.message());
  if (bytes > max_bytes)
    throw BadInput(file.string(), 0, 0, fmt::format("at most {} bytes", max_bytes),
                   fmt::format("{}", bytes));
  std::string text(std::size_t(bytes), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(text.data(), std::streamsize(bytes));
  if (!stream) throw BadInput(file.string(), 0, 0, "a readable file", "one that cannot be read");
  return text;
}

Lines::Lines(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
}

std::optional<std::string_view> Lines::next() {
  if (rest_.empty()) return std::nullopt;
  ++number_;
  const std::size_t end = rest_.find('\n');
  std::string_view line = rest_.substr(0, end);
  rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) {
    if (c >= ' ' && c <= '~')
      out += c;
    else
      out += fmt::format("\\x{:02X}", static_cast<unsigned char>(c));
  }
  return text.size() > 40 ? out + "..." : out;
}

}  // namespace abbe::sim::program
