#include "render/vtk_xml.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>
#include <system_error>

#include <fmt/format.h>

#include "kinematics/bad_input.h"

namespace abbe::render {

VtkFile::VtkFile(const std::filesystem::path& path, const std::string& kind,
                 std::uintmax_t max_bytes)
    : path_(path.string()) {
  std::error_code failure;
  if (!std::filesystem::is_regular_file(path, failure)) refuse_file(kind, "no such file");
  const std::uintmax_t size = std::filesystem::file_size(path, failure);
  if (failure || size > max_bytes)
    refuse_file(fmt::format("at most {} MiB", max_bytes >> 20), fmt::format("{} bytes", size));
  std::ifstream stream(path, std::ios::binary);
  text_.assign(std::istreambuf_iterator<char>(stream), {});
  if (!stream) refuse_file("a file that can be read", "an error while reading");
}

void VtkFile::refuse_file(const std::string& expected, const std::string& seen) const {
  throw BadInput(path_, 0, 0, expected, seen);
}

void VtkFile::refuse(std::size_t at, const std::string& expected, const std::string& seen) const {
  const auto end = text_.begin() + std::ptrdiff_t(std::min(at, text_.size()));
  throw BadInput(path_, 1 + int(std::count(text_.begin(), end, '\n')), 0, expected, seen);
}

std::optional<VtkTag> VtkTags::next() {
  for (;;) {
    at_ = text_.find('<', at_);
    if (at_ == std::string_view::npos) return std::nullopt;
    if (text_.substr(at_).starts_with("<!--")) {
      skip_to("-->");
    } else if (text_.substr(at_).starts_with("<?") || text_.substr(at_).starts_with("<!")) {
      skip_to(">");
    } else {
      return tag();
    }
  }
}

void VtkTags::skip_to(std::string_view end) {
  const std::size_t found = text_.find(end, at_);
  if (found == std::string_view::npos)
    source_.refuse(at_, "the end of a comment", shown(text_.substr(at_)));
  at_ = found + end.size();
}

VtkTag VtkTags::tag() {
  VtkTag tag;
  tag.at = at_++;
  const std::size_t name_end = std::min(text_.find_first_of(" \t\r\n>", at_), text_.size());
  tag.name = text_.substr(at_, name_end - at_);
  if (tag.name.size() > 1 && tag.name.ends_with('/')) tag.name.remove_suffix(1);
  at_ = name_end;
  while (read_attribute(tag)) {
  }
  tag.inner = text_.substr(at_, text_.find('<', at_) - at_);
  return tag;
}

bool VtkTags::read_attribute(VtkTag& tag) {
  at_ = text_.find_first_not_of(" \t\r\n/?", at_);
  if (at_ == std::string_view::npos) source_.refuse(tag.at, "the end of a tag", "the file's end");
  if (text_[at_] == '>') {
    ++at_;
    return false;
  }
  const std::size_t equals = text_.find_first_of("=>", at_);
  const bool quoted = equals != std::string_view::npos && text_[equals] == '=' &&
                      equals + 1 < text_.size() &&
                      (text_[equals + 1] == '"' || text_[equals + 1] == '\'');
  const std::size_t end =
      quoted ? text_.find(text_[equals + 1], equals + 2) : std::string_view::npos;
  if (end == std::string_view::npos)
    source_.refuse(tag.at, "attributes as name=\"value\"", shown(text_.substr(at_)));
  const std::string_view name = text_.substr(at_, equals - at_);
  if (tag.attributes.size() > 100) source_.refuse(tag.at, "at most 100 attributes", "more");
  if (!tag.attributes.emplace(name, text_.substr(equals + 2, end - equals - 2)).second)
    source_.refuse(tag.at, "every attribute once", shown(name));
  at_ = end + 1;
  return true;
}

std::string_view attribute(const VtkTag& tag, std::string_view name, std::string_view otherwise) {
  const auto found = tag.attributes.find(name);
  return found == tag.attributes.end() ? otherwise : found->second;
}

std::size_t whole_number(const VtkFile& source, const VtkTag& tag, std::string_view name) {
  const std::string_view text = attribute(tag, name, "");
  std::size_t value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size())
    source.refuse(tag.at, fmt::format("a whole number as {} of {}", name, tag.name), shown(text));
  return value;
}

std::string shown(std::string_view text) {
  std::string printable;
  for (const char c : text.substr(0, 40)) printable += c >= ' ' && c <= '~' ? c : '?';
  return "\"" + printable + (text.size() > 40 ? "...\"" : "\"");
}

}  // namespace abbe::render
