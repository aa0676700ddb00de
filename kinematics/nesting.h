#pragma once

#include <algorithm>
#include <string_view>

/// The one limit on how deep a text from outside may nest. Readers descend by recursion: without it
/// a file of nothing but brackets ends the stack.
namespace abbe {

/// Levels of brackets, signs, functions, parameters, tables or arrays within each other.
inline constexpr int max_nesting = 100;

/// One level of a recursive descent, counted in `depth` while it lives.
class NestingLevel {
 public:
  explicit NestingLevel(int& depth) : depth_(depth) { ++depth_; }
  ~NestingLevel() { --depth_; }
  NestingLevel(const NestingLevel&) = delete;
  NestingLevel& operator=(const NestingLevel&) = delete;

  bool too_deep() const { return depth_ > max_nesting; }

 private:
  int& depth_;
};

/// Returns how deep the brackets and braces of a JSON text nest, those in strings left out. Its
/// values are copied, written and thrown away by recursion, so this is asked before it is parsed.
inline int json_nesting(std::string_view text) {
  int depth = 0, deepest = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted && c == '\\') ++i;
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    if (c == '[' || c == '{') deepest = std::max(deepest, ++depth);
    if (c == ']' || c == '}') --depth;
  }
  return deepest;
}

}  // namespace abbe
