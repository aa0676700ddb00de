#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// Text from outside on its way to a terminal, a table or a JSON file.
namespace abbe {

/// The same text on one line that any terminal can show: letters of UTF-8 stay, and what would act
/// on a terminal or turn the reading order is spelt out. Control characters below U+0020 and bytes
/// that are not UTF-8 read \x1b; DEL, the controls U+0080 to U+009F, line and paragraph separators,
/// bidirectional and other invisible marks of format read \u202e, as JSON spells them. What is
/// escaped stays as it is when it is escaped again.
std::string escaped(std::string_view text);

/// The same, but the ends of its lines and its tabs stay.
std::string escaped_lines(std::string_view text);

/// Throws std::invalid_argument of this text unless `holds`.
inline void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}
inline void require(bool holds, const std::string& what) { require(holds, what.c_str()); }

/// Refusal of something that came from outside: where it stands, what was expected, what was seen.
/// `what()` reads "file:line:column: expected ..., seen ...". Line and column count from 1; 0 is
/// "not known" and is left out of the text. It is one line, with what came from outside escaped;
/// the members are as they came.
struct BadInput : std::runtime_error {
  BadInput(std::string file, int line, int column, std::string expected, std::string seen);

  std::string file;
  int line;
  int column;
  std::string expected;
  std::string seen;
};

/// All that is wrong with something from outside, in the order found; a fault found twice is kept
/// once, and beyond 200 no more but one that says so.
class InputErrorList {
 public:
  static constexpr std::size_t most = 200;

  void add(const BadInput& fault);
  const std::vector<BadInput>& list() const { return list_; }
  bool empty() const { return list_.empty(); }
  bool full() const { return list_.size() > most; }

 private:
  std::vector<BadInput> list_;
};

}  // namespace abbe
