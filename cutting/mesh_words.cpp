#include "cutting/mesh_words.h"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "kinematics/text.h"

namespace abbe::cutting {

using Eigen::Vector3d;

namespace {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v'; }

}  // namespace

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return out;
}

Words::Words(const MeshSource& source, char comment, std::size_t offset, int line)
    : source_(source), text_(source.bytes), at_(offset), line_(line), comment_(comment) {
  if (text_.substr(at_, 3) == "\xef\xbb\xbf") at_ += 3;
  line_start_ = at_;
}

Word Words::next() {
  skip(true);
  return take();
}

Word Words::next_in_line() {
  skip(false);
  return take();
}

Word Words::rest_of_line() {
  Word rest = next_in_line();
  for (Word word = rest; !word.text.empty(); word = next_in_line())
    rest.text = {rest.text.data(),
                 std::size_t(word.text.data() + word.text.size() - rest.text.data())};
  return rest;
}

void Words::skip_line() {
  while (at_ < text_.size() && text_[at_] != '\n') ++at_;
}

bool Words::at_end() {
  skip(true);
  return at_ >= text_.size();
}

void Words::expect(std::string_view keyword, const Word& seen) const {
  if (lower(seen.text) != keyword) refuse(fmt::format("'{}'", keyword), seen);
}

double Words::number(const Word& word) const {
  std::string_view digits = word.text;
  if (digits.size() > 1 && digits[0] == '+') digits.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  const bool whole = !digits.empty() && end == digits.data() + digits.size();
  if (!whole || error != std::errc() || !std::isfinite(value)) refuse("a finite number", word);
  return value;
}

Vector3d Words::point() {
  const double x = number();
  const double y = number();
  const double z = number();
  return {x, y, z};
}

std::int64_t Words::integer(const Word& word, std::int64_t least, std::int64_t most,
                            const std::string& what) const {
  std::int64_t value = 0;
  const char* end = word.text.data() + word.text.size();
  const auto parsed = std::from_chars(word.text.data(), end, value);
  if (word.text.empty() || parsed.ec != std::errc() || parsed.ptr != end || value < least ||
      value > most)
    refuse(least == most ? fmt::format("{} {}", what, least)
                         : fmt::format("{} ({} .. {})", what, least, most),
           word);
  return value;
}

void Words::refuse(const std::string& expected, const Word& seen) const {
  source_.refuse(expected, seen.text.empty() ? "the end" : in_quotes(seen.text), seen.line,
                 seen.column);
}

void Words::skip(bool over_lines) {
  while (at_ < text_.size()) {
    const char c = text_[at_];
    if (c == '\n') {
      if (!over_lines) return;
      ++at_;
      ++line_;
      line_start_ = at_;
    } else if (is_space(c)) {
      ++at_;
    } else if (comment_ != '\0' && c == comment_) {
      skip_line();
    } else {
      return;
    }
  }
}

Word Words::take() {
  const std::size_t first = at_;
  while (at_ < text_.size() && text_[at_] != '\n' && !is_space(text_[at_])) ++at_;
  return {text_.substr(first, at_ - first), line_, static_cast<int>(first - line_start_) + 1};
}

}  // namespace abbe::cutting
